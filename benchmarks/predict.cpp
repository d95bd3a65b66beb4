#include "predict.hpp"

#include <algorithm>

#include <piecework/core/statistics.hpp>

namespace piecework::bench {
namespace {

using global::TreeSchedule;
using Time = double TreeSchedule::Part::*;

/// Makespan of independent tasks, the longest first onto the least busy core.
double makespan(const std::vector<TreeSchedule::Part>& tasks, Time time, int cores) {
  std::vector<double> times;
  for (const auto& task : tasks) times.push_back(task.*time);
  std::sort(times.rbegin(), times.rend());
  std::vector<double> busy(static_cast<std::size_t>(cores), 0.0);
  for (const double t : times) *std::min_element(busy.begin(), busy.end()) += t;
  return *std::max_element(busy.begin(), busy.end());
}

double limited(double ms, double bytes, int cores, const Machine& machine) {
  return machine.bandwidth > 0 && cores > 1 ? std::max(ms, bytes / machine.bandwidth) : ms;
}

double phase_of_tasks(const TreeSchedule& schedule, Time time, Time bytes, int cores,
                      const Machine& machine) {
  double total = 0;
  for (const auto& task : schedule.tasks) total += task.*bytes;
  const double barrier = cores > 1 ? machine.barrier_ms : 0;
  return limited(makespan(schedule.tasks, time, cores), total, cores, machine) + barrier;
}

double phase_of_fronts(const TreeSchedule& schedule, Time time, Time bytes,
                       int TreeSchedule::Front::*tiles, int cores, const Machine& machine) {
  double total = 0;
  for (std::size_t i = 0; i < schedule.fronts.size();) {
    const int level = schedule.fronts[i].level;
    double work = 0;
    double longest = 0;
    double read = 0;
    int panels = 0;
    for (; i < schedule.fronts.size() && schedule.fronts[i].level == level; ++i) {
      const TreeSchedule::Front& front = schedule.fronts[i];
      work += front.*time;
      read += front.*bytes;
      longest = std::max(longest, front.*time / std::min(cores, front.*tiles));
      panels = std::max(panels, front.*tiles > 1 ? front.panels : 0);
    }
    const double barriers = cores > 1 ? (1 + panels) * machine.barrier_ms : 0;
    total += limited(std::max(work / cores, longest), read, cores, machine) + barriers;
  }
  return total;
}

}  // namespace

double predicted_ms(const TreeSchedule& schedule, int cores, const Machine& machine) {
  using Part = TreeSchedule::Part;
  using Front = TreeSchedule::Front;
  return phase_of_tasks(schedule, &Part::forward_ms, &Part::forward_bytes, cores, machine) +
         phase_of_fronts(schedule, &Part::forward_ms, &Part::forward_bytes, &Front::forward_tiles,
                         cores, machine) +
         phase_of_fronts(schedule, &Part::backward_ms, &Part::backward_bytes,
                         &Front::backward_tiles, cores, machine) +
         phase_of_tasks(schedule, &Part::backward_ms, &Part::backward_bytes, cores, machine);
}

TreeSchedule median_schedule(const std::vector<TreeSchedule>& schedules) {
  TreeSchedule result = schedules.front();
  const auto median = [&](const auto& part_of, Time time) {
    std::vector<double> times;
    for (const auto& schedule : schedules) times.push_back(part_of(schedule).*time);
    return median_interval(std::move(times)).median;
  };
  for (const Time time : {&TreeSchedule::Part::forward_ms, &TreeSchedule::Part::backward_ms}) {
    for (std::size_t i = 0; i < result.tasks.size(); ++i)
      result.tasks[i].*time =
          median([&](const auto& s) -> const TreeSchedule::Part& { return s.tasks[i]; }, time);
    for (std::size_t i = 0; i < result.fronts.size(); ++i)
      result.fronts[i].*time =
          median([&](const auto& s) -> const TreeSchedule::Part& { return s.fronts[i]; }, time);
  }
  return result;
}

}  // namespace piecework::bench
