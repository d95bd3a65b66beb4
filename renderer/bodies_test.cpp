// Bodies beside the cloth: their edges, their place in the picture, light between them and cloth.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <renderer/display_mesh.hpp>
#include <renderer/renderer.hpp>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

struct Solid {
  Positions positions;
  Triangles triangles;
  [[nodiscard]] Body body() const { return {&positions, triangles}; }
};

Solid make_box(const Vec3& low, const Vec3& high) {
  Solid box;
  box.positions.resize(8, 3);
  for (int i = 0; i < 8; ++i)
    box.positions.row(i) << ((i & 1) != 0 ? high : low).x(), ((i & 2) != 0 ? high : low).y(),
        ((i & 4) != 0 ? high : low).z();
  for (const auto& [a, b, c, d] :
       {std::array{0, 4, 6, 2}, std::array{1, 3, 7, 5}, std::array{0, 1, 5, 4},
        std::array{2, 6, 7, 3}, std::array{0, 2, 3, 1}, std::array{4, 5, 7, 6}}) {
    box.triangles.push_back({a, b, c});
    box.triangles.push_back({a, c, d});
  }
  return box;
}

/// A tube with flat ends about y: `sides` + 1 vertices on each end.
Solid make_drum(int sides) {
  Solid drum;
  drum.positions.resize(2 * sides + 2, 3);
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    drum.positions.row(i) << std::sin(angle), -1, std::cos(angle);
    drum.positions.row(sides + i) << std::sin(angle), 1, std::cos(angle);
  }
  const int bottom = 2 * sides;
  drum.positions.row(bottom) << 0, -1, 0;
  drum.positions.row(bottom + 1) << 0, 1, 0;
  for (int i = 0; i < sides; ++i) {
    const int j = (i + 1) % sides;
    drum.triangles.push_back({i, j, sides + j});
    drum.triangles.push_back({i, sides + j, sides + i});
    drum.triangles.push_back({bottom, j, i});
    drum.triangles.push_back({bottom + 1, sides + i, sides + j});
  }
  return drum;
}

/// A level square sheet, y = height, x and z in [-half, half].
Solid make_sheet(double height, double half, int cells = 8) {
  Solid sheet;
  const int side = cells + 1;
  sheet.positions.resize(side * side, 3);
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i)
      sheet.positions.row(j * side + i) << half * (2.0 * i / cells - 1), height,
          half * (2.0 * j / cells - 1);
  for (int j = 0; j < cells; ++j)
    for (int i = 0; i < cells; ++i) {
      const int a = j * side + i;
      sheet.triangles.push_back({a, a + side, a + side + 1});
      sheet.triangles.push_back({a, a + side + 1, a + 1});
    }
  return sheet;
}

Frame frame_of(const Solid& cloth, std::span<const Body> bodies) {
  Frame frame;
  frame.positions = &cloth.positions;
  frame.triangles = cloth.triangles;
  frame.bodies = bodies;
  return frame;
}

Vec3f face_normal(const DisplayMesh& mesh, const Triangle& t) {
  const Vec3f& p = mesh.positions[t[0]];
  return (mesh.positions[t[1]] - p).cross(mesh.positions[t[2]] - p).normalized();
}

TEST(Bodies, EdgesOfABoxAreSharp) {
  const Solid box = make_box({-1, -1, -1}, {1, 1, 1});
  const std::array one{box.body()};
  const DisplayMesh mesh = build_display_mesh(frame_of({}, one), 0);
  ASSERT_EQ(mesh.triangles.size(), 12U);
  EXPECT_TRUE(mesh.cloth().empty());
  EXPECT_EQ(mesh.positions.size(), 24U) << "three sides meet at each of the eight corners";
  for (const Triangle& t : mesh.triangles) {
    const Vec3f outward = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    EXPECT_GT(face_normal(mesh, t).dot(outward), 0.3F);
    for (const int v : t) EXPECT_GT(mesh.normals[v].dot(face_normal(mesh, t)), 0.9999F);
  }
}

TEST(Bodies, RoundSidesAreSmoothAndRimsSharp) {
  constexpr int kSides = 24;  // 15 degrees between neighbours
  const Solid drum = make_drum(kSides);
  const std::array one{drum.body()};
  const DisplayMesh mesh = build_display_mesh(frame_of({}, one), 0);
  EXPECT_EQ(mesh.positions.size(), 4U * kSides + 2);
  int on_side = 0;
  for (const Triangle& t : mesh.triangles) {
    const bool is_end = std::abs(face_normal(mesh, t).y()) > 0.5F;
    for (const int v : t) {
      Vec3f radial = mesh.positions[v];
      radial.y() = 0;
      if (is_end) {
        EXPECT_GT(std::abs(mesh.normals[v].y()), 0.9999F);
        continue;
      }
      ++on_side;
      EXPECT_GT(mesh.normals[v].dot(radial.normalized()), 0.99F) << "the circle's normal";
    }
  }
  EXPECT_EQ(on_side, 6 * kSides);
}

TEST(Bodies, TheClothDecidesTheUnits) {
  const Solid cloth = make_sheet(0, 1);
  const double alone = build_display_mesh(frame_of(cloth, {}), 0).scale;
  const auto scale_with = [&](const Solid& solid) {
    const std::array one{solid.body()};
    return build_display_mesh(frame_of(cloth, one), 0).scale;
  };
  EXPECT_LT(scale_with(make_box({-0.5, -0.5, -0.5}, {0.5, 0, 0.5})), alone);
  EXPECT_EQ(scale_with(make_box({90, 0, 0}, {91, 1, 1})), alone) << "too far away to count";
  const double in_hall = scale_with(make_box({-1e3, -1e3, -1e3}, {1e3, 1e3, 1e3}));
  EXPECT_GT(in_hall, alone / 7);
  EXPECT_LT(in_hall, alone);
}

constexpr int kWidth = 320;
constexpr int kHeight = 240;

class BodyPictures : public testing::Test {
 protected:
  void SetUp() override {
    const auto reports = probe_providers();
    if (std::none_of(reports.begin(), reports.end(), [](const auto& r) { return r.works; }))
      GTEST_SKIP() << "no OpenGL provider works: " << reports.front().detail;
    style_.color = ColorMode::Shaded;
    style_.fabric = {0.25F, 0.45F, 0.85F};
  }

  [[nodiscard]] Image draw(const Solid& cloth, const Solid* solid) const {
    std::vector<Body> bodies;
    if (solid != nullptr) bodies.push_back(solid->body());
    return Renderer(Provider::Auto, kWidth, kHeight).draw(frame_of(cloth, bodies), camera_, style_);
  }

  /// Pixel of a point, by similar triangles.
  [[nodiscard]] std::array<int, 3> at(const Image& image, const Vec3& p) const {
    const Vec3 z = (camera_.eye - camera_.target).normalized();
    const Vec3 x = camera_.up.cross(z).normalized();
    const Vec3 d = p - camera_.eye;
    const double focal =
        kHeight / 2.0 / std::tan(camera_.fov_degrees * std::numbers::pi / 360.0) / -d.dot(z);
    const auto column = static_cast<std::size_t>(kWidth / 2.0 + focal * d.dot(x));
    const auto row = static_cast<std::size_t>(kHeight / 2.0 - focal * d.dot(z.cross(x)));
    const std::size_t i = 3 * (row * kWidth + column);
    return {image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]};
  }

  static bool is_blue(const std::array<int, 3>& p) { return p[2] > p[0] + 40; }
  static bool is_grey(const std::array<int, 3>& p) {
    return std::abs(p[0] - p[2]) < 30 && p[0] < 215 && p[0] > 40;
  }
  static int sum(const std::array<int, 3>& p) { return p[0] + p[1] + p[2]; }

  Camera camera_{{1.2, 2.2, 2.8}, {0, 0, 0}, {0, 1, 0}, 40};
  Style style_;
};

TEST_F(BodyPictures, AreGreyAndCoverWhatIsBehindThem) {
  const Solid cloth = make_sheet(0, 1);
  const Solid box = make_box({-0.3, 0.2, -0.3}, {0.3, 0.5, 0.3});
  const Image with = draw(cloth, &box);
  const Image without = draw(cloth, nullptr);
  EXPECT_TRUE(is_grey(at(with, {0, 0.5, 0})));
  EXPECT_TRUE(is_blue(at(without, {0, 0, 0})));
  EXPECT_TRUE(is_blue(at(with, {-0.8, 0, 0.8})));
}

TEST_F(BodyPictures, AndClothShadeEachOther) {
  const Solid sheet = make_sheet(0, 1);
  const Solid above = make_box({-0.4, 0.1, -0.4}, {0.4, 0.2, 0.4});
  const Vec3 beside(0.45, 0, 0.2);  // away from the key light
  EXPECT_LT(sum(at(draw(sheet, &above), beside)), sum(at(draw(sheet, nullptr), beside)) - 40);
  const Solid table = make_box({-1, -0.2, -1}, {1, 0, 1});
  const Solid small = make_sheet(0.15, 0.4);
  const Solid elsewhere = make_sheet(-0.5, 0.4);
  const Vec3 under(0.42, 0, 0.1);
  EXPECT_LT(sum(at(draw(small, &table), under)), sum(at(draw(elsewhere, &table), under)) - 40);
}

// Vertices keep their distance from a body, triangles between them may not.
TEST_F(BodyPictures, DoNotShowThroughClothThatLiesOnThem) {
  const Solid table = make_box({-1, -0.5, -1}, {1, 0, 1});
  for (const double height : {1e-4, 0.0, -1e-3}) {
    const Solid cloth = make_sheet(height, 0.8);
    const Image image = draw(cloth, &table);
    int blue = 0;
    for (int i = -18; i <= 18; ++i)
      for (int j = -18; j <= 18; ++j)
        blue += is_blue(at(image, {0.04 * i, height, 0.04 * j})) ? 1 : 0;
    EXPECT_EQ(blue, 37 * 37) << height;
    EXPECT_TRUE(is_grey(at(image, {0.9, 0, 0.9}))) << height;
  }
}

TEST_F(BodyPictures, TheBackOfClothCanBeDarker) {
  Solid cloth = make_sheet(0, 1);
  const Vec3 middle(0.1, 0, 0.1);
  const int front = sum(at(draw(cloth, nullptr), middle));
  style_.back = 0.5F;
  EXPECT_EQ(sum(at(draw(cloth, nullptr), middle)), front);
  for (Triangle& t : cloth.triangles) std::swap(t[1], t[2]);
  const int back = sum(at(draw(cloth, nullptr), middle));
  style_.back = 1;
  EXPECT_LT(back, sum(at(draw(cloth, nullptr), middle)) - 60);
}

TEST_F(BodyPictures, FaultsAreNamed) {
  const Solid cloth = make_sheet(0, 1);
  Solid box = make_box({0, 0, 0}, {1, 1, 1});
  box.triangles[3][1] = 8;
  EXPECT_THROW((void)draw(cloth, &box), InputError);
  box = make_box({0, 0, 0}, {1, 1, 1});
  box.positions(2, 1) = std::nan("");
  try {
    (void)draw(cloth, &box);
    FAIL() << "drew a body that is nowhere";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("body 0: vertex 2"), std::string::npos)
        << error.what();
  }
  style_.back = 1.5F;
  EXPECT_THROW((void)draw(cloth, nullptr), InputError);
}

}  // namespace
}  // namespace piecework::render
