#include "traces.hpp"

#include <limits>

#include <gtest/gtest.h>

namespace piecework::bench {
namespace {

Series run(int iterations, int notable = -1) {
  Series series;
  for (int i = 0; i <= iterations; ++i) series.add({.iteration = i}, i == notable);
  return series;
}

bool holds(const Series& series, int iteration) {
  for (const TracePoint& point : series.points())
    if (point.iteration == iteration) return true;
  return false;
}

TEST(Traces, ShortRunsAreKeptWhole) { EXPECT_EQ(run(40).points().size(), 41u); }

TEST(Traces, LongRunsAreThinnedButKeepTheirEnd) {
  const Series series = run(20001);
  EXPECT_LT(series.points().size(), 220u);
  EXPECT_EQ(series.points().back().iteration, 20001);
  for (std::size_t i = 1; i < series.points().size(); ++i)
    EXPECT_LT(series.points()[i - 1].iteration, series.points()[i].iteration);
}

TEST(Traces, NotablePointsAreKept) {
  ASSERT_FALSE(holds(run(5000), 4321));
  EXPECT_TRUE(holds(run(5000, 4321), 4321));
}

TEST(Traces, Json) {
  Trace trace{.family = "f", .method = "m", .cloth = "c", .n = 9, .threads = 2, .h = 0.5};
  trace.series.add({1, 2.5, 0.125, 0.25, std::numeric_limits<double>::infinity(), 4});
  EXPECT_EQ(traces_json({trace}), R"({"schema": "piecework.traces/1",
"columns": ["iteration", "ms", "energy_error", "position_error", "gradient", "dx_2"],
"traces": [
{"family": "f", "method": "m", "cloth": "c", "n": 9, "threads": 2, "h": 0.5, "points": [
[1, 2.5, 0.125, 0.25, null, 4]]}
]}
)");
}

}  // namespace
}  // namespace piecework::bench
