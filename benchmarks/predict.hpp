#pragma once

// How long a solve would take on more cores than there are here: a model, not a measurement.

#include <vector>

#include <piecework/global/tree_schedule.hpp>

namespace piecework::bench {

/// What the model knows of a machine.
struct Machine {
  double barrier_ms = 0;  ///< one parallel loop without work, all threads
  double bandwidth = 0;   ///< bytes per ms that all cores together can read; 0: no limit
};

/// Tasks go to the least busy core, the longest first; the fronts of a level share the cores, none
/// takes more than it has tiles, and each panel costs a barrier; no phase is faster than the
/// bandwidth allows.
double predicted_ms(const global::TreeSchedule& schedule, int cores, const Machine& machine);

/// The median of every time in schedules of one tree.
global::TreeSchedule median_schedule(const std::vector<global::TreeSchedule>& schedules);

}  // namespace piecework::bench
