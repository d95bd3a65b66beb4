#include <piecework/runner/record.hpp>

#include <sstream>

#include <gtest/gtest.h>

#include <piecework/runner/environment.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

RunRecord some_record(int frames, bool refactor) {
  RunRecord record;
  record.environment_json = to_json(describe_environment());
  record.method = "test method";
  record.threads = 2;
  for (int i = 1; i <= frames; ++i) {
    FrameRecord frame;
    model::StepReport report;
    report.step_ms = 10.0 + i;
    report.phases = {.local = 4.3 + i,
                     .global = 5.0,
                     .refactor = (refactor && i == 2) ? 1.5 : -1.0,
                     .misc = 0.5};
    report.iterations = 7;
    report.converged = true;
    report.gradient = 1e-3 * i;
    frame.add(report);
    model::State state;
    state.step = i;
    state.time = 0.01 * i;
    frame.finish(i, state);
    record.frames.push_back(frame);
  }
  return record;
}

TEST(FrameRecord, MeansOverItsSteps) {
  FrameRecord frame;
  model::StepReport report;
  report.phases = {.local = 1, .global = 2, .refactor = -1, .misc = 0.5};
  report.step_ms = 4;
  report.gradient = 3;
  report.iterations = 5;
  frame.add(report);
  report.phases.refactor = 6;
  report.step_ms = 10;
  report.gradient = 1;
  report.converged = true;
  frame.add(report);
  frame.finish(1, {.x = {}, .v = {}, .time = 0.2, .step = 2});
  EXPECT_EQ(frame.step_ms, 7);
  EXPECT_EQ(frame.phases.refactor, 3) << "one refactorisation of 6 ms over two steps";
  EXPECT_EQ(frame.other_ms(), 7 - 1 - 2 - 0.5 - 3);
  EXPECT_EQ(frame.gradient, 3);
  EXPECT_EQ(frame.iterations, 10);
  EXPECT_EQ(frame.converged_steps, 1);
}

TEST(Record, JsonKeepsFramesForAContinuedRun) {
  const auto world = build_world(small_scene());
  RunRecord record = some_record(5, true);
  record.expectations = {{"lowest_y at 0.03 s: any to 0", true, -0.2, true},
                         {"center_y at the end", false, 0, false}};
  const RecordedPart part = recorded_part(to_json(record, *world), "run.json", 4);
  ASSERT_EQ(part.frames.size(), 4U);
  EXPECT_EQ(part.frames[3].step_ms, record.frames[3].step_ms);
  EXPECT_EQ(part.frames[1].phases.refactor, 1.5);
  EXPECT_LT(part.frames[0].phases.refactor, 0);
  EXPECT_EQ(part.frames[3].gradient, record.frames[3].gradient);
  ASSERT_EQ(part.expectations.size(), 1U);
  EXPECT_EQ(part.expectations[0].text, record.expectations[0].text);
}

TEST(Record, CsvHasOneRowPerFrameAndPhase) {
  std::istringstream csv(to_csv(some_record(3, false)));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, "frame,step,time_s,phase,ms_per_step\r");
  int rows = 0;
  int refactor = 0;
  while (std::getline(csv, line)) {
    ++rows;
    refactor += line.find("refactor") != std::string::npos;
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 4) << line;
  }
  EXPECT_EQ(rows, 3 * 5);
  EXPECT_EQ(refactor, 0);
}

TEST(Record, MarkdownPrintsDashesForWhatIsOff) {
  const auto world = build_world(small_scene());
  const std::string text = to_markdown(some_record(8, false), *world);
  EXPECT_NE(text.find("| small | 4 | 168 |"), std::string::npos) << text;
  EXPECT_NE(text.find("| Refactorisation (Ref.) | - | - | - | 0 |"), std::string::npos) << text;
  EXPECT_NE(text.find("14.5 [11.0-18.0]"), std::string::npos)
      << "median of 11..18 and its interval";
  EXPECT_NE(text.find("8 of 8 steps reached it"), std::string::npos);
  EXPECT_EQ(text.find("nan"), std::string::npos);
  EXPECT_EQ(text.find("†"), std::string::npos);
  RunRecord disturbed = some_record(8, false);
  disturbed.threads = 1 << 10;  // no spare processor
  disturbed.other_processors = 0.5;
  EXPECT_NE(to_markdown(disturbed, *world).find("† Disturbed"), std::string::npos);
}

TEST(Record, NoFrameIsSaidNotDividedBy) {
  const auto world = build_world(small_scene());
  EXPECT_NE(to_markdown(some_record(0, false), *world).find("No step was simulated"),
            std::string::npos);
}

}  // namespace
}  // namespace piecework::runner
