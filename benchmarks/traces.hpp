#pragma once

// Traces: what a minimiser reached after each iteration, as JSON, for the fronts of
// ci/convergence_tables.

#include <cstdint>
#include <string>
#include <vector>

namespace piecework::bench {

/// After one iteration; 0 is the start.
struct TracePoint {
  int iteration = 0;
  double ms = 0, energy_error = 0, position_error = 0, gradient = 0, dx_2 = 0;
};

/// A run. Of long ones only some points are kept: curves over logarithmic axes need no more.
class Series {
 public:
  /// In the order of iterations. `notable` points are kept in any case, and so is the last one.
  void add(const TracePoint& point, bool notable = false);
  [[nodiscard]] const std::vector<TracePoint>& points() const { return points_; }

 private:
  std::vector<TracePoint> points_;
  int next_ = 0;              ///< the iteration to be kept next
  bool last_may_go_ = false;  ///< the last point is there only because it is the last
};

/// A run with what tells it from others.
struct Trace {
  std::string family, method, cloth;
  std::int64_t n = 0;  ///< vertices
  int threads = 0;
  double h = 0;  ///< time step, s
  Series series;
};

/// {"schema": "piecework.traces/1", "columns": [...], "traces": [{..., "points": [[...], ...]}]};
/// what is not finite is null.
std::string traces_json(const std::vector<Trace>& traces);

}  // namespace piecework::bench
