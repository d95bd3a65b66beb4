#pragma once

// The processor as `piecework tune` sees it: kinds of cores, and how fast each kind is. Nothing
// else may ask: results are a function of mesh and scene only.

#include <filesystem>
#include <string>
#include <vector>

namespace piecework::runner {

/// Cores that are alike.
struct CoreKind {
  std::string name;
  int cores = 1;                ///< that this process may use
  int threads = 1;              ///< hardware threads of these cores
  int efficiency = -1;          ///< hwloc's rank: higher is faster and thirstier; -1: unknown
  double speed = 1;             ///< of one core on one thread, in any unit; only ratios count
  std::vector<int> processors;  ///< their numbers in the operating system; none if simulated
};

/// Never without a kind.
struct Topology {
  std::vector<CoreKind> kinds;  ///< fastest first, as far as that is known
  std::string source;           ///< "this machine", or the file

  [[nodiscard]] int cores() const;
  /// All kinds have the same speed.
  [[nodiscard]] bool uniform() const;
};

/// The cores that this process may use (CPU affinity), by kind. Speeds are 1 until measured.
Topology machine_topology();

/// A simulated machine: {"kinds": [{"name": "performance", "cores": 8, "speed": 1.0}, ...]}, and
/// per kind optionally "threads" (default: cores).
/// \throws InputError "<file>: <pointer>: <problem>; <remedy>".
Topology load_topology(const std::filesystem::path& file);

/// Sets the speed of every kind: 1 for the fastest, in steps of 0.05, at least 0.05. One fixed
/// solve on one thread is timed on a core of each kind in turn, a fixed number of times; the median
/// counts. The thread's affinity is as before afterwards. With one kind nothing is measured.
/// \returns whether speeds are measured; if not (a core may not be used alone), all are 1.
/// \throws SimulationError if memory does not suffice.
bool measure_speeds(Topology& topology);

}  // namespace piecework::runner
