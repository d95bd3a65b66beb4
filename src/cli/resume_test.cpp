// Runs that are killed or interrupted, and what they leave.

#include <csignal>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli_test_util.hpp"

namespace piecework::cli {
namespace {

class CliKilled : public Cli {
 protected:
  /// Runs a scene as a whole, and again with a kill as soon as each of these frames is there;
  /// returns what run.json said after each kill and at the end.
  [[nodiscard]] std::vector<nlohmann::json> run_killed(const std::string& path,
                                                       const std::vector<int>& until) const {
    EXPECT_EQ(call("run " + path + " --no-images --export ply -o " + dir("whole")).code, 0);
    std::vector<nlohmann::json> records;
    int kills = 0;
    for (const int frame : until) {
      const pid_t child = start({"run", path, "--no-images", "--export", "ply",
                                 "--checkpoint-every", "2", "--resume", "-o", dir("killed")});
      EXPECT_TRUE(wait_for(fs::path(dir("killed")) / frame_name(frame)));
      kill(child, SIGKILL);
      int status = 0;
      waitpid(child, &status, 0);
      kills += WIFSIGNALED(status);
      records.push_back(nlohmann::json::parse(read_file(dir("killed/run.json"))));
    }
    EXPECT_GT(kills, 0) << "every run was over before it could be killed";
    EXPECT_EQ(call("run " + path + " --no-images --export ply --resume -o " + dir("killed")).code,
              0);
    records.push_back(nlohmann::json::parse(read_file(dir("killed/run.json"))));
    return records;
  }
  void expect_same_frames(int last) const {
    for (int frame = 0; frame <= last; ++frame)
      ASSERT_TRUE(read_file(fs::path(dir("whole")) / frame_name(frame)) ==
                  read_file(fs::path(dir("killed")) / frame_name(frame)))
          << frame;
  }

 private:
  [[nodiscard]] static std::string frame_name(int frame) {
    return fmt::format("frame_{:04}.ply", frame);
  }
};

TEST_F(CliKilled, RunResumesWithTheSameBits) {
  const auto records = run_killed(scene(60, 40), {3, 11, 23});
  expect_same_frames(40);
  EXPECT_EQ(records.back().at("frames").size(), 40U);
}

/// A sheet with friction falls on a ball of triangles that turns and moves.
constexpr const char* kTouching = R"({"name": "touching", "step": {"steps": 30},
    "self_collision": true, "friction": 0.4, "kinetic_friction": 0.3, "solver": {"domains": 4},
    "materials": {"m": {"stretching": 261, "bending": 1e-5}},
    "cloths": [{"material": "m", "translate": [-0.25, 0.103, -0.25],
      "mesh": {"generator": "sheet", "width": 0.5, "height": 0.5, "columns": 30, "rows": 30}}],
    "colliders": [{"shape": "sphere", "radius": 0.1, "surface": "triangles", "segments": 4,
      "motion": {"velocity": [0.1, 0.05, 0], "rate": 3}}]})";

TEST_F(CliKilled, RunResumesWithTheSameBitsAmidContact) {
  write_file_atomically(folder_ / "touching.json", kTouching);
  const auto records = run_killed(dir("touching.json"), {13, 19, 24});
  expect_same_frames(30);
  EXPECT_EQ(records.back().at("frames").size(), 30U);
  for (const auto& record : records) {
    const auto& frame = record.at("frames").back();
    EXPECT_GT(frame.at("counters").at("contact_pairs"), 50) << frame.at("frame");
    EXPECT_EQ(frame.at("counters").at("interpenetrations"), 0);
  }
  EXPECT_LT(records.front().at("frames").size(), 30U) << "checkpoints in the middle";
  EXPECT_GT(records.front().at("frames").size(), 10U);
}

TEST_F(Cli, InterruptStopsWithACheckpointAndExitCode130) {
  const std::string path = scene(60, 400);
  const pid_t child = start({"run", path, "--no-images", "-o", dir("i")});
  ASSERT_TRUE(wait_for(dir("i/state/frame_0002.bin")));
  kill(child, SIGINT);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_TRUE(fs::exists(dir("i/checkpoint.bin")));
  const auto json = nlohmann::json::parse(read_file(dir("i/run.json")));
  EXPECT_GE(json.at("frames").size(), 2U);
  EXPECT_LT(json.at("frames").size(), 400U);
}

}  // namespace
}  // namespace piecework::cli
