#include "traces.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace piecework::bench {
namespace {

constexpr int kAllUpTo = 40;      // iterations: each is kept
constexpr double kGrowth = 1.04;  // beyond: one in every 4 %

int after(int iteration) {
  return std::max(iteration + 1,
                  iteration < kAllUpTo ? 0 : static_cast<int>(std::lround(kGrowth * iteration)));
}

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.5g}", value) : "null";
}

std::string json(const TracePoint& p) {
  return fmt::format("[{}, {}, {}, {}, {}, {}]", p.iteration, number(p.ms), number(p.energy_error),
                     number(p.position_error), number(p.gradient), number(p.dx_2));
}

std::string json(const Trace& trace) {
  std::string points;
  for (const TracePoint& point : trace.series.points())
    points += (points.empty() ? "\n" : ",\n") + json(point);
  return fmt::format(
      R"({{"family": "{}", "method": "{}", "cloth": "{}", "n": {}, "threads": {}, "h": {}, )"
      R"("points": [{}]}})",
      trace.family, trace.method, trace.cloth, trace.n, trace.threads, number(trace.h), points);
}

}  // namespace

void Series::add(const TracePoint& point, bool notable) {
  if (last_may_go_) points_.pop_back();
  const bool due = point.iteration >= next_;
  last_may_go_ = !due && !notable;
  if (due) next_ = after(point.iteration);
  points_.push_back(point);
}

std::string traces_json(const std::vector<Trace>& traces) {
  std::string all;
  for (const Trace& trace : traces) all += (all.empty() ? "\n" : ",\n") + json(trace);
  return fmt::format(R"({{"schema": "piecework.traces/1",
"columns": ["iteration", "ms", "energy_error", "position_error", "gradient", "dx_2"],
"traces": [{}
]}}
)",
                     all);
}

}  // namespace piecework::bench
