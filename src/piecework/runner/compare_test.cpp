#include <piecework/runner/compare.hpp>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <piecework/core/error.hpp>

#include "saved_run_test_util.hpp"
#include "small_scene.hpp"

namespace piecework::runner {
namespace {

class Compare : public ::testing::Test {
 protected:
  Comparison compare(const MadeRun& a, const MadeRun& b) {
    make_run(folder_.path() / "a", a);
    make_run(folder_.path() / "b", b);
    return compare_runs(folder_.path() / "a", folder_.path() / "b");
  }
  void expect_refused(const MadeRun& a, const MadeRun& b, const std::string& fragment) {
    try {
      (void)compare(a, b);
      ADD_FAILURE() << "compared, but should say: " << fragment;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos) << error.what();
    }
  }
  TemporaryFolder folder_;
};

// One of four vertices is 0.3 m off at every time; the reference falls 0.3 m in 3 steps of 0.1 s.
TEST_F(Compare, MeasuresAKnownOffset) {
  const Comparison c = compare({.offset = 0.3, .step_ms = 2, .energy = 7}, {.step_ms = 8});
  ASSERT_EQ(c.frames.size(), 3U) << "time 0 is left out";
  for (const FrameError& f : c.frames) {
    EXPECT_NEAR(f.max, 0.3, 1e-15);
    EXPECT_NEAR(f.rms, 0.15, 1e-15) << "sqrt(0.3^2 / 4)";
    EXPECT_EQ(f.energy, -3.0);
  }
  EXPECT_NEAR(c.max, 0.3, 1e-15);
  EXPECT_NEAR(c.rms, 0.15, 1e-15);
  EXPECT_NEAR(c.motion, 0.3, 1e-15);
  EXPECT_NEAR(c.relative, 1.0, 1e-14);
  EXPECT_EQ(c.time_ratio, 0.25);
}

// The error grows with time: A falls at 1.5 m/s, B at 1 m/s, for 0.1, 0.2 and 0.3 s.
TEST_F(Compare, MaximaAndMeansAreOverTimesToo) {
  const Comparison c = compare({.speed = 1.5}, {.speed = 1});
  EXPECT_NEAR(c.frames[0].max, 0.05, 1e-15);
  EXPECT_NEAR(c.frames[2].max, 0.15, 1e-15);
  EXPECT_NEAR(c.max, 0.15, 1e-15);
  EXPECT_NEAR(c.rms, 0.05 * std::sqrt((1 + 4 + 9) / 3.0), 1e-15);
  EXPECT_NEAR(c.relative, 0.5, 1e-14);
}

TEST_F(Compare, FramesMeetByTimeNotByNumber) {
  // A: h = 0.1, frames at 0.1 ... 0.6; B: h = 0.05, frames every 0.15 s up to 0.45 s.
  const Comparison c =
      compare({.h = 0.1, .frames = 6, .offset = 0.3}, {.h = 0.05, .output_every = 3, .frames = 3});
  ASSERT_EQ(c.frames.size(), 1U);
  EXPECT_NEAR(c.frames[0].time, 0.3, 1e-15);
  EXPECT_EQ(c.frames[0].frame_a, 3);
  EXPECT_EQ(c.frames[0].frame_b, 2);
  EXPECT_NEAR(c.max, 0.3, 1e-15);
  EXPECT_FALSE(c.frames[0].energy) << "the incremental potential depends on h";
  EXPECT_EQ(c.ms_a.count, 3U) << "times up to the last common frame";
  EXPECT_EQ(c.ms_b.count, 2U);
}

TEST_F(Compare, ARunEqualsItself) {
  make_run(folder_.path() / "a", {});
  const Comparison c = compare_runs(folder_.path() / "a", folder_.path() / "a");
  EXPECT_EQ(c.max, 0);
  EXPECT_EQ(c.rms, 0);
  EXPECT_EQ(c.relative, 0);
  EXPECT_EQ(c.time_ratio, 1);
}

TEST_F(Compare, RelativeToNoMotionIsNoNumber) {
  EXPECT_EQ(compare({.speed = 0}, {.speed = 0}).relative, 0);
  const Comparison c = compare({.speed = 0, .offset = 0.1}, {.speed = 0});
  EXPECT_TRUE(std::isinf(c.relative));
  EXPECT_TRUE(nlohmann::json::parse(to_json(c)).at("relative").is_null());
}

TEST_F(Compare, RefusesWhatDoesNotCompare) {
  expect_refused({.vertices = 6}, {}, "have 6 and 4 vertices");
  expect_refused({.triangles = 3}, {}, "have 3 and 2 triangles");
  expect_refused({.triangles_hash = "u"}, {}, "triangles between different vertices");
  expect_refused({.start_shift = 1e-3}, {}, "start up to 0.001 m apart");
  expect_refused({.h = 0.1, .frames = 2}, {.h = 0.07, .frames = 3},
                 "no time after 0 in common (2 frames from 0.1 to 0.2 s, 3 frames from 0.07 to "
                 "0.21 s)");
  expect_refused({.frames = 0}, {}, "no time after 0 in common (no frame, ");
  EXPECT_EQ(compare({.triangles_hash = ""}, {}).max, 0) << "not recorded by earlier versions";
}

TEST_F(Compare, RefusesWhatIsNotThere) {
  make_run(folder_.path() / "a", {});
  const auto message = [&](const char* name) -> std::string {
    try {
      (void)compare_runs(folder_.path() / "a", folder_.path() / name);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_NE(message("nowhere").find("no such folder"), std::string::npos) << message("nowhere");
  ensure_directory(folder_.path() / "empty");
  EXPECT_NE(message("empty").find("has no run.json"), std::string::npos);
  ensure_directory(folder_.path() / "damaged");
  write_file_atomically(folder_.path() / "damaged/run.json",
                        R"({"frames": [], "expectations": []})");
  EXPECT_NE(message("damaged").find("not a run record"), std::string::npos);
  std::filesystem::remove_all(folder_.path() / "b");
  make_run(folder_.path() / "b", {.states = false});
  EXPECT_NE(message("b").find("--no-state"), std::string::npos) << message("b");
}

TEST_F(Compare, RunsOfOurOwnCompare) {
  class Nobody : public RunObserver {
    void started(const World&, int, int) override {}
    void frame_done(const World&, const model::State&, int, const FrameRecord*) override {}
    bool should_stop() override { return false; }
  } nobody;
  const auto simulate = [&](const char* name, const std::vector<scene::Override>& overrides) {
    (void)run(small_scene(overrides), {.directory = folder_.path() / name}, nobody);
    return folder_.path() / name;
  };
  const auto base = simulate("base", {});
  EXPECT_EQ(compare_runs(simulate("same", {{"solver.domains", "4"}}), base).max, 0);
  const Comparison rougher =
      compare_runs(simulate("less", {{"quality.max_iterations", "2"}}), base);
  EXPECT_EQ(rougher.frames.size(), 8U);
  EXPECT_GT(rougher.max, 0);
  EXPECT_GE(rougher.max, rougher.rms);
  EXPECT_GT(rougher.time_ratio, 0);
  EXPECT_THROW(
      (void)compare_runs(simulate("mesh", {{"cloths.0.mesh.pattern", "one_diagonal"}}), base),
      InputError)
      << "the same vertices, other triangles";
}

TEST_F(Compare, JsonHasTheKeysThatScriptsRelyOn) {
  const auto json = nlohmann::json::parse(to_json(compare({.offset = 0.3}, {})));
  EXPECT_EQ(json.at("schema"), "piecework.compare/1");
  EXPECT_NEAR(json.at("max").get<double>(), 0.3, 1e-15);
  EXPECT_NEAR(json.at("rms").get<double>(), 0.15, 1e-15);
  EXPECT_NEAR(json.at("relative").get<double>(), 1, 1e-14);
  EXPECT_EQ(json.at("time_ratio"), 1);
  EXPECT_EQ(json.at("interleaved"), false);
  ASSERT_EQ(json.at("frames").size(), 3U);
  EXPECT_NEAR(json.at("frames").at(1).at("time_s").get<double>(), 0.2, 1e-15);
}

TEST_F(Compare, TableIsSmallAndShowsTheEnd) {
  const std::string text = to_markdown(compare({.frames = 95, .offset = 0.3}, {.frames = 95}));
  EXPECT_EQ(std::count(text.begin(), text.end(), '|'), 5 * (2 + 10 + 1)) << text;
  EXPECT_NE(text.find("| 9.5 | 0.300 | 0.150 | 0 |"), std::string::npos) << text;
  EXPECT_NE(text.find("| **all** | 0.300 | 0.150 |"), std::string::npos) << text;
  EXPECT_NE(text.find("not interleaved"), std::string::npos);
}

}  // namespace
}  // namespace piecework::runner
