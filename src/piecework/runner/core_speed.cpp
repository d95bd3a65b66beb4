// How fast a core of each kind is, measured by a solve like those of a simulation.

#include <sched.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <vector>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/statistics.hpp>
#include <piecework/global/exact_solver.hpp>
#include <piecework/runner/topology.hpp>

namespace piecework::runner {
namespace {

/// Processors that a kernel may have; larger than cpu_set_t's 1024.
constexpr int kMaxProcessors = 16384;
constexpr std::size_t kWords = kMaxProcessors / (8 * sizeof(unsigned long));

/// A set of processors in the kernel's form.
class ProcessorSet {
 public:
  [[nodiscard]] bool read() { return ::sched_getaffinity(0, bytes(), set()) == 0; }
  [[nodiscard]] bool apply() { return ::sched_setaffinity(0, bytes(), set()) == 0; }
  void add(int processor) {
    if (processor < kMaxProcessors) CPU_SET_S(processor, bytes(), set());
  }

 private:
  static constexpr std::size_t bytes() { return kWords * sizeof(unsigned long); }
  cpu_set_t* set() { return reinterpret_cast<cpu_set_t*>(words_.data()); }  // NOLINT: sched.h's own
  std::vector<unsigned long> words_ = std::vector<unsigned long>(kWords, 0);
};

/// Puts the calling thread's affinity back at the end.
class AffinityGuard {
 public:
  AffinityGuard() : known_(before_.read()) {}
  ~AffinityGuard() {
    if (known_ && !before_.apply()) errno = 0;  // a processor went away: nothing to go back to
  }
  AffinityGuard(const AffinityGuard&) = delete;
  AffinityGuard& operator=(const AffinityGuard&) = delete;
  [[nodiscard]] bool known() const { return known_; }

 private:
  ProcessorSet before_;
  bool known_;
};

/// The 5-point matrix of a square of side x side vertices, positive definite.
SparseMatrix grid_matrix(int side) {
  std::vector<Eigen::Triplet<double, int>> entries;
  const auto couple = [&](int a, int b) {
    entries.emplace_back(a, b, -1.0);
    entries.emplace_back(b, a, -1.0);
  };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const int v = j * side + i;
      entries.emplace_back(v, v, 4.1);
      if (i + 1 < side) couple(v, v + 1);
      if (j + 1 < side) couple(v, v + side);
    }
  SparseMatrix K(side * side, side * side);
  K.setFromTriplets(entries.begin(), entries.end());
  return K;
}

/// Median times, ms, of a kind's solves; empty if a core may not be had.
std::vector<double> time_kinds(const Topology& topology) {
  constexpr int kSide = 120;
  constexpr int kRounds = 11;
  constexpr int kSolves = 4;  // per sample
  const auto solver = global::make_tree_solver({}, {});
  const SparseMatrix K = grid_matrix(kSide);
  const std::vector<int> rows(static_cast<std::size_t>(K.rows()), 0);
  if (solver->factor(K, rows) != global::SolveStatus::Ok)
    throw SimulationError("the speed of the cores cannot be measured: out of memory");
  global::RightHandSides b = global::RightHandSides::Ones(K.rows(), 3);
  std::vector<std::vector<double>> samples(topology.kinds.size());
  for (int round = 0; round < kRounds; ++round)
    for (std::size_t k = 0; k < topology.kinds.size(); ++k) {
      ProcessorSet one;
      one.add(topology.kinds[k].processors.front());
      if (!one.apply()) return {};
      bool good = solver->solve(b) == global::SolveStatus::Ok;  // warms the caches of this core
      Stopwatch watch;
      for (int i = 0; i < kSolves; ++i) good = solver->solve(b) == global::SolveStatus::Ok && good;
      samples[k].push_back(watch.lap());
      b.setOnes();
      if (!good) return {};
    }
  std::vector<double> medians;
  for (const std::vector<double>& kind : samples) medians.push_back(median_interval(kind).median);
  return medians;
}

}  // namespace

bool measure_speeds(Topology& topology) {
  for (CoreKind& kind : topology.kinds) kind.speed = 1;
  if (topology.kinds.size() < 2) return false;
  for (const CoreKind& kind : topology.kinds)
    if (kind.processors.empty()) return false;
  const AffinityGuard guard;
  if (!guard.known()) return false;
  // One thread, the calling one, which is the one that is pinned.
  const std::vector<double> ms = ThreadPool(1).run([&] { return time_kinds(topology); });
  if (ms.empty()) return false;
  const double fastest = *std::min_element(ms.begin(), ms.end());
  constexpr double kSteps = 20;  // finer differences are noise
  for (std::size_t k = 0; k < ms.size(); ++k)
    topology.kinds[k].speed = std::max(1.0, std::round(kSteps * fastest / ms[k])) / kSteps;
  std::stable_sort(topology.kinds.begin(), topology.kinds.end(),
                   [](const CoreKind& a, const CoreKind& b) { return a.speed > b.speed; });
  return true;
}

}  // namespace piecework::runner
