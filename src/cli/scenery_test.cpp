// Colliders in pictures: what is drawn where, and pictures of whole runs.

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/scene/scene_io.hpp>
#include <renderer/png.hpp>
#include <renderer/renderer.hpp>

#include "scenery.hpp"

namespace piecework::cli {
namespace {

namespace fs = std::filesystem;

/// A small cloth at height 0.3 with the given colliders; it hardly moves in two short steps.
std::string scene_with(const std::string& colliders) {
  return R"({"name": "t", "step": {"h": 0.001, "steps": 2}, "solver": {"domains": 2},
    "materials": {"m": {"stretching": 261, "bending": 1e-5}},
    "cloths": [{"material": "m", "translate": [-0.2, 0.3, -0.2],
                "mesh": {"generator": "sheet", "width": 0.4, "height": 0.4, "columns": 9, "rows": 9}}],
    "camera": {"azimuth": 0, "elevation": 20}, "render": {"size": [320, 240]},
    "colliders": [)" +
         colliders + "]}";
}

std::unique_ptr<runner::World> world_with(const std::string& colliders) {
  return runner::build_world(scene::parse_scene(scene_with(colliders), "t.json"));
}

Bounds box(const Vec3& low, const Vec3& high) {
  Bounds bounds;
  bounds.low = low;
  bounds.high = high;
  return bounds;
}

constexpr const char* kBall =
    R"({"name": "b1", "shape": "sphere", "center": [0, 0.1, 0], "radius": 0.15,
                                   "motion": {"velocity": [2, 0, 0]}})";

TEST(Scenery, TheGroundIsTheHighestLevelPlaneThatFacesUp) {
  EXPECT_FALSE(level_ground(*world_with(kBall), 0));
  const auto world = world_with(
      R"({"name": "b2", "shape": "plane", "point": [3, -0.5, 0]},
         {"name": "b3", "shape": "plane", "point": [0, -2, 0], "normal": [0, 3, 0],
          "motion": {"velocity": [0, 1, 0]}},
         {"name": "b4", "shape": "plane", "point": [0, 5, 0], "normal": [0, -1, 0]},
         {"name": "b5", "shape": "plane", "point": [0, 0, 0], "normal": [0.1, 1, 0]})");
  EXPECT_DOUBLE_EQ(level_ground(*world, 0).value(), -0.5);
  EXPECT_DOUBLE_EQ(level_ground(*world, 1.75).value(), -0.25);
}

TEST(Scenery, LevelPlanesAndWallsSeenFromBehindAreNotDrawn) {
  const auto world = world_with(
      R"({"name": "b6", "shape": "plane", "point": [0, -1, 0]},
         {"name": "b7", "shape": "plane", "point": [0, 0, -2], "normal": [0, 0, 1]},
         {"name": "b8", "shape": "plane", "point": [0, 5, 0], "normal": [0, -1, 0]},)" +
      std::string(kBall));
  const Bounds cloth = box({-0.2, 0.3, -0.2}, {0.2, 0.3, 0.2});
  EXPECT_EQ(bodies_at(*world, 0, {0, 1, 3}, cloth).size(), 3U);
  EXPECT_EQ(bodies_at(*world, 0, {0, 9, 3}, cloth).size(), 2U) << "above the ceiling";
  EXPECT_EQ(bodies_at(*world, 0, {0, 9, -3}, cloth).size(), 1U) << "and behind the wall";
}

TEST(Scenery, BodiesAreWhereTheyAreAtTheTime) {
  const auto world = world_with(kBall);
  const Bounds cloth = box({-0.2, 0.3, -0.2}, {0.2, 0.3, 0.2});
  for (const double time : {0.0, 0.5}) {
    Bounds ball;
    for (const auto& body : bodies_at(*world, time, {0, 1, 3}, cloth)) ball.include(body.positions);
    EXPECT_LT((ball.low - Vec3(2 * time - 0.15, -0.05, -0.15)).norm(), 0.01) << time;
    EXPECT_LT((ball.high - Vec3(2 * time + 0.15, 0.25, 0.15)).norm(), 0.01) << time;
    EXPECT_LT((bounds_of_bodies(*world, time).low - ball.low).norm(), 1e-12);
  }
  EXPECT_TRUE(bounds_of_bodies(*world_with(R"({"name": "b9", "shape": "plane", "normal": [1, 1, 0]},
      {"name": "b10", "shape": "half_spaces", "planes": [{"normal": [1, 0, 0]}, {"normal": [0, 1, 0]}]})"),
                               0)
                  .empty())
      << "unbounded";
}

TEST(Scenery, TheCameraSeesBodiesWholeUnlessTheyWouldMakeTheClothSmall) {
  const Bounds cloth = box({0, 0, 0}, {1, 0, 1});
  EXPECT_EQ(framed(cloth, {}).high, cloth.high);
  const Bounds wearer = framed(cloth, box({0.4, -1.2, 0.4}, {0.6, 0.4, 0.6}));
  EXPECT_EQ(wearer.low, Vec3(0, -1.2, 0));
  EXPECT_EQ(wearer.high, Vec3(1, 0.4, 1));
  const Bounds hall = framed(cloth, box({-50, -50, -50}, {50, 50, 50}));
  EXPECT_LT(hall.size(), 2);
  EXPECT_GT(hall.size(), 1);
  const Bounds beside = framed(cloth, box({40, 0, 0}, {41, 1, 1}));
  EXPECT_LT(beside.size(), 2);
}

class RunPictures : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("piecework_scenery_{}", ::getpid());
    fs::create_directories(folder_);
    if (call("doctor") != 0) GTEST_SKIP() << "no OpenGL here (libosmesa6 or EGL)";
  }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] int call(const std::string& arguments) const {
    const int status = std::system(fmt::format("'{}' {} >'{}' 2>&1 </dev/null", PIECEWORK_PROGRAM,
                                               arguments, (folder_ / "said").string())
                                       .c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] std::string said() const { return read_file(folder_ / "said"); }

  /// Runs the scene; frame 0 and frame 2 as pictures.
  std::pair<render::Image, render::Image> run(const std::string& scene, const std::string& more) {
    write_file_atomically(folder_ / "scene.json", scene);
    const fs::path out = folder_ / "out";
    EXPECT_EQ(call(fmt::format("run {} --overwrite -o {} {}", (folder_ / "scene.json").string(),
                               out.string(), more)),
              0)
        << said();
    return {render::read_png(out / "frame_0000.png"), render::read_png(out / "frame_0002.png")};
  }

  fs::path folder_;
};

/// Pixels that are neither cloth (coloured) nor background (light): how many, and their mean
/// column.
std::pair<int, double> grey(const render::Image& image) {
  int count = 0;
  double columns = 0;
  for (std::size_t i = 0; i < image.rgb.size() / 3; ++i) {
    const int r = image.rgb[3 * i], g = image.rgb[3 * i + 1], b = image.rgb[3 * i + 2];
    const bool is_grey = std::max({r, g, b}) - std::min({r, g, b}) < 32 && r < 200 && r > 60;
    count += is_grey ? 1 : 0;
    columns += is_grey ? static_cast<double>(i % static_cast<std::size_t>(image.width)) : 0.0;
  }
  return {count, count > 0 ? columns / count : 0};
}

TEST_F(RunPictures, ShowCollidersAndTheirMotion) {
  const std::string fast =
      R"({"name": "b11", "shape": "sphere", "center": [0, 0.1, 0], "radius": 0.15,
                               "motion": {"velocity": [60, 0, 0]}})";
  const auto [first, last] = run(scene_with(fast), "--fast-images --color shaded");
  const auto [before, x_before] = grey(first);
  const auto [after, x_after] = grey(last);
  EXPECT_GT(before, 1500);
  EXPECT_GT(after, 1500);
  EXPECT_GT(x_after - x_before, 15) << "pixels that 0.12 m are to the right";
}

// Under the plane y = 0 the picture's ground has its shadows elsewhere than far below the cloth.
TEST_F(RunPictures, LevelPlanesAreTheGround) {
  const auto floor = [](double y) {
    return scene_with(
        fmt::format(R"({{"name": "b12", "shape": "plane", "point": [0, {}, 0]}})", y));
  };
  const auto high = run(floor(0.25), "").first;
  const auto low = run(floor(-3), "").first;
  EXPECT_NE(high.rgb, low.rgb);
  EXPECT_GT(grey(high).first, grey(low).first + 200) << "the shadow close below the cloth";
}

TEST_F(RunPictures, ContactHasAColour) {
  const std::string near = R"({"name": "b13", "shape": "plane", "point": [0, 0.2995, 0]})";
  const auto touching = run(scene_with(near), "--color contact").first;
  const auto apart =
      run(scene_with(R"({"name": "b14", "shape": "plane", "point": [0, 0.2985, 0]})"),
          "--color contact")
          .first;
  std::size_t strong = 0, strong_apart = 0;
  for (std::size_t i = 0; i < touching.rgb.size(); i += 3) {
    strong += touching.rgb[i] > touching.rgb[i + 2] + 60 ? 1U : 0U;
    strong_apart += apart.rgb[i] > apart.rgb[i + 2] + 60 ? 1U : 0U;
  }
  EXPECT_GT(strong, strong_apart + 3000);
  const auto by_key = run(scene_with(near), "--set render.color=contact").first;
  EXPECT_TRUE(by_key.rgb == touching.rgb) << "the scene may say so, too";
}

TEST_F(RunPictures, ContactIsRefusedWhereNothingCanTouch) {
  write_file_atomically(folder_ / "scene.json", scene_with(""));
  EXPECT_EQ(call(fmt::format("run {} --color contact -o {}", (folder_ / "scene.json").string(),
                             (folder_ / "none").string())),
            3);
  EXPECT_NE(said().find("nothing can touch"), std::string::npos) << said();
  EXPECT_FALSE(fs::exists(folder_ / "none")) << "refused before anything is simulated";
}

}  // namespace
}  // namespace piecework::cli
