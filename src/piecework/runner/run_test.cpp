#include <piecework/runner/run.hpp>

#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/runner/checkpoint.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;

/// Stops after a given frame, and counts.
class Watcher : public RunObserver {
 public:
  explicit Watcher(int stop_after = -1) : stop_after_(stop_after) {}
  void started(const World&, int first_frame, int) override { first = first_frame; }
  void frame_done(const World&, const model::State& state, int frame, const FrameRecord*) override {
    last = frame;
    x = state.x;
  }
  bool should_stop() override { return last == stop_after_; }
  int first = -1;
  int last = -1;
  Positions x;

 private:
  int stop_after_;
};

RunOutcome simulate(const fs::path& directory, Watcher& watcher, RunOptions options = {},
                    const scene::Scene& scene = small_scene()) {
  options.directory = directory;
  return run(scene, options, watcher);
}

TEST(Run, WritesItsFiles) {
  const TemporaryFolder folder;
  Watcher watcher;
  const RunOutcome outcome = simulate(
      folder.path(), watcher,
      {.exports = {mesh::ExportFormat::Ply, mesh::ExportFormat::Obj, mesh::ExportFormat::Vtp}});
  EXPECT_EQ(outcome.frames_done, 8);
  EXPECT_TRUE(outcome.expectations_hold());
  EXPECT_EQ(outcome.record.expectations.size(), 2U);
  for (const char* name : {"scene.resolved.json", "run.json", "timings.csv", "summary.md",
                           "checkpoint.bin", "frame_0000.ply", "frame_0008.ply", "frame_0008.obj",
                           "frame_0008.vtp", "state/frame_0000.bin", "state/frame_0008.bin"})
    EXPECT_TRUE(fs::exists(folder.path() / name)) << name;
}

TEST(Run, RecordHasEverythingAndPhasesSumToTheStep) {
  const TemporaryFolder folder;
  Watcher watcher;
  (void)simulate(folder.path(), watcher);
  const auto json = nlohmann::json::parse(read_file(folder.path() / "run.json"));
  EXPECT_EQ(json.at("schema"), "piecework.run/1");
  EXPECT_TRUE(json.at("environment").contains("cpu"));
  EXPECT_EQ(json.at("scene").at("dof"), 168);
  EXPECT_EQ(json.at("scene").at("domains").at("domains"), 4);
  ASSERT_EQ(json.at("frames").size(), 8U);
  for (const auto& frame : json.at("frames")) {
    double sum = 0;
    for (const auto& [phase, ms] : frame.at("phases_ms").items()) sum += ms.get<double>();
    EXPECT_NEAR(sum, frame.at("step_ms").get<double>(), 1e-9) << "`other` closes the sum";
    EXPECT_LE(frame.at("step_ms_min").get<double>(), frame.at("step_ms_max").get<double>());
    EXPECT_GE(frame.at("phases_ms").at("other").get<double>(), 0);
    EXPECT_FALSE(frame.at("phases_ms").contains("refactor")) << "a phase that is off has no key";
    EXPECT_EQ(frame.at("counters").at("iterations"), 6);
    EXPECT_GT(frame.at("gradient").get<double>(), 0);
  }
}

TEST(Run, ContinuedRunHasTheSameBits) {
  const TemporaryFolder whole;
  const TemporaryFolder broken;
  Watcher unbroken;
  (void)simulate(whole.path(), unbroken);
  Watcher first(3);
  EXPECT_TRUE(simulate(broken.path(), first).stopped);
  EXPECT_EQ(first.last, 3);
  write_file_atomically(broken.path() / "frame_0004.ply.tmp4711", "left by a kill");
  write_file_atomically(broken.path() / "mine.tmp4711", "not ours");
  Watcher second;
  const RunOutcome outcome = simulate(broken.path(), second, {.threads = 3, .resume = true});
  EXPECT_FALSE(fs::exists(broken.path() / "frame_0004.ply.tmp4711"));
  EXPECT_TRUE(fs::exists(broken.path() / "mine.tmp4711"));
  EXPECT_EQ(second.first, 3);
  EXPECT_EQ(outcome.frames_done, 8);
  EXPECT_TRUE(second.x == unbroken.x);
  EXPECT_EQ(outcome.record.frames.size(), 8U);
  // The expectation at 0.03 s was met before the break and is remembered.
  EXPECT_EQ(outcome.record.expectations.size(), 2U);
  for (int frame = 0; frame <= 8; ++frame)
    EXPECT_EQ(read_file(whole.path() / "state" / (frame_name(frame) + ".bin")),
              read_file(broken.path() / "state" / (frame_name(frame) + ".bin")))
        << frame;
}

// What the log says of a step must be what the record says, and a continued log must be the whole.
TEST(Run, LogsEveryIterationIfAsked) {
  const TemporaryFolder whole;
  Watcher watcher;
  const RunOutcome outcome = simulate(whole.path(), watcher, {.log_iterations = true});
  const std::string text = read_file(whole.path() / "iterations.csv");
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  EXPECT_TRUE(line.starts_with("step,iteration,energy_j,"));
  int count = 0;
  std::string last;
  while (std::getline(lines, line)) {
    ++count;
    last = line;
  }
  // One line for the start of each step, one per iteration.
  EXPECT_EQ(count, totals(outcome.record.frames).iterations + totals(outcome.record.frames).steps);
  const FrameRecord& frame = outcome.record.frames.back();
  EXPECT_TRUE(last.starts_with(
      fmt::format("{},{},{:.9g},", frame.step, frame.iterations / frame.steps, frame.energy)))
      << last;

  const TemporaryFolder halves;
  Watcher stops(3);
  (void)simulate(halves.path(), stops, {.log_iterations = true});
  Watcher goes_on;
  (void)simulate(halves.path(), goes_on, {.log_iterations = true});
  EXPECT_EQ(read_file(halves.path() / "iterations.csv"), text);

  const TemporaryFolder unasked;
  (void)simulate(unasked.path(), watcher);
  EXPECT_FALSE(fs::exists(unasked.path() / "iterations.csv"));
}

TEST(Run, CompleteRunIsLeftAlone) {
  const TemporaryFolder folder;
  Watcher watcher;
  (void)simulate(folder.path(), watcher);
  const std::string record = read_file(folder.path() / "run.json");
  Watcher again;
  const RunOutcome outcome = simulate(folder.path(), again);
  EXPECT_EQ(again.first, 8);
  EXPECT_EQ(again.last, -1) << "no frame was simulated";
  EXPECT_EQ(read_file(folder.path() / "run.json"), record);
  EXPECT_TRUE(outcome.expectations_hold());
  EXPECT_EQ(outcome.record.expectations.size(), 2U);
}

TEST(Run, OtherSceneIsRefusedUnlessOverwritten) {
  const TemporaryFolder folder;
  Watcher watcher;
  (void)simulate(folder.path(), watcher, {.frames = 2});
  const scene::Scene other = small_scene({{"materials.cotton.density", "1"}});
  write_file_atomically(folder.path() / "notes.txt", "mine");
  EXPECT_THROW((void)simulate(folder.path(), watcher, {}, other), InputError);
  EXPECT_EQ(simulate(folder.path(), watcher, {.frames = 1, .overwrite = true}, other).frames_done,
            1);
  EXPECT_FALSE(fs::exists(folder.path() / "state" / "frame_0002.bin")) << "left from the old run";
  EXPECT_EQ(read_file(folder.path() / "notes.txt"), "mine") << "not ours to delete";
}

TEST(Run, SameBitsForEveryThreadCount) {
  const scene::Scene scene =
      small_scene({{"cloths.0.mesh.columns", "40"}, {"cloths.0.mesh.rows", "40"}});
  Positions expected;
  for (const int threads : {1, 2, 4, 8}) {
    const TemporaryFolder folder;
    Watcher watcher;
    (void)simulate(folder.path(), watcher, {.threads = threads, .save_states = false}, scene);
    if (threads == 1) expected = watcher.x;
    EXPECT_TRUE(watcher.x == expected) << threads;
  }
}

TEST(Run, FramesOfSeveralSteps) {
  const TemporaryFolder folder;
  Watcher watcher;
  const RunOutcome outcome =
      simulate(folder.path(), watcher, {}, small_scene({{"step.output_every", "4"}}));
  EXPECT_EQ(outcome.frames_done, 2);
  EXPECT_EQ(outcome.record.frames.at(1).step, 8);
  EXPECT_EQ(outcome.record.frames.at(1).steps, 4);
  EXPECT_EQ(outcome.record.frames.at(1).iterations, 24);
}

TEST(Run, FailedStepKeepsWhatWasDone) {
  const TemporaryFolder folder;
  Watcher watcher;
  // A load that begins in the third step and overflows; scene files may not ask for so much.
  scene::Scene scene = small_scene();
  scene::Load load{.force = {1e308, 0, 0}, .start = 0.015};
  load.region.vertices = {20};
  scene.cloths[0].loads.push_back(load);
  EXPECT_THROW((void)simulate(folder.path(), watcher, {.checkpoint_every = 1}, scene),
               SimulationError);
  const auto json = nlohmann::json::parse(read_file(folder.path() / "run.json"));
  EXPECT_EQ(json.at("frames").size(), 2U);
  EXPECT_EQ(read_state(folder.path() / "checkpoint.bin", motion_hash(*build_world(scene)), 56).step,
            2);
}

TEST(Run, ContinuedRunExportsEarlierFramesToo) {
  const TemporaryFolder folder;
  Watcher watcher(3);
  (void)simulate(folder.path(), watcher);
  Watcher rest;
  (void)simulate(folder.path(), rest, {.exports = {mesh::ExportFormat::Ply}});
  for (int frame = 0; frame <= 8; ++frame)
    EXPECT_TRUE(fs::exists(folder.path() / (frame_name(frame) + ".ply"))) << frame;
  // Without saved states that is refused, not left out.
  const TemporaryFolder stateless;
  Watcher first(3);
  (void)simulate(stateless.path(), first, {.save_states = false});
  EXPECT_THROW((void)simulate(stateless.path(), rest, {.exports = {mesh::ExportFormat::Ply}}),
               InputError);
}

TEST(Run, ExpectationsBeyondTheRunDoNotHold) {
  const TemporaryFolder folder;
  Watcher watcher;
  const RunOutcome outcome = simulate(folder.path(), watcher, {.frames = 2});
  ASSERT_EQ(outcome.record.expectations.size(), 2U);
  EXPECT_FALSE(outcome.record.expectations[0].reached) << "0.03 s lies beyond two steps";
  EXPECT_FALSE(outcome.record.expectations[1].reached) << "the end is step 8";
  EXPECT_FALSE(outcome.expectations_hold());
}

TEST(Run, TwoRunsDoNotMixInOneDirectory) {
  const TemporaryFolder folder;
  // While one run is in its first frame, another one tries.
  class Intruder : public Watcher {
   public:
    explicit Intruder(const fs::path& directory) : directory_(directory) {}
    void frame_done(const World& world, const model::State& state, int frame,
                    const FrameRecord* record) override {
      Watcher::frame_done(world, state, frame, record);
      if (frame > 0) return;
      Watcher second;
      EXPECT_THROW((void)simulate(directory_, second, {.overwrite = true}), InputError);
      ++tries;
    }
    int tries = 0;

   private:
    fs::path directory_;
  };
  Intruder intruder(folder.path());
  EXPECT_EQ(simulate(folder.path(), intruder).frames_done, 8);
  EXPECT_EQ(intruder.tries, 1);
}

TEST(Run, TakesOnlyItsOwnFiles) {
  const TemporaryFolder folder;
  Watcher watcher;
  (void)simulate(folder.path(), watcher, {.frames = 1});
  write_file_atomically(folder.path() / "frame_notes.txt", "mine");
  write_file_atomically(folder.path() / "state" / "frame_plan.md", "mine");
  (void)simulate(folder.path(), watcher, {.frames = 1, .overwrite = true});
  EXPECT_TRUE(fs::exists(folder.path() / "frame_notes.txt"));
  EXPECT_TRUE(fs::exists(folder.path() / "state" / "frame_plan.md"));
  const TemporaryFolder foreign;
  write_file_atomically(foreign.path() / "summary.md", "my own report");
  EXPECT_THROW((void)simulate(foreign.path(), watcher), InputError);
  EXPECT_EQ(read_file(foreign.path() / "summary.md"), "my own report");
}

TEST(Run, CheckpointWithoutItsRecordIsRefused) {
  const TemporaryFolder folder;
  Watcher watcher(3);
  (void)simulate(folder.path(), watcher);
  write_file_atomically(folder.path() / "run.json", R"({"frames": [], "expectations": []})");
  EXPECT_THROW((void)simulate(folder.path(), watcher), InputError);
  write_file_atomically(folder.path() / "run.json", "{");
  EXPECT_THROW((void)simulate(folder.path(), watcher), InputError);
}

}  // namespace
}  // namespace piecework::runner
