#include <piecework/core/parallel.hpp>

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>

#include <tbb/global_control.h>

namespace piecework {
namespace {

int affinity_threads() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof set, &set) != 0) return 1;
  return std::max(1, CPU_COUNT(&set));
}

/// CPU quota of cgroup v2 ("max 100000" or "200000 100000"), rounded up; a large number if none.
int cgroup_threads() {
  constexpr int kUnlimited = 1 << 20;
  std::ifstream file("/sys/fs/cgroup/cpu.max");
  std::string quota;
  double period = 0;
  if (!(file >> quota >> period) || quota == "max" || period <= 0) return kUnlimited;
  return std::max(1, static_cast<int>(std::ceil(std::stod(quota) / period)));
}

}  // namespace

struct ThreadPool::Limit {
  explicit Limit(int threads)
      : control(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads)) {}
  tbb::global_control control;
};

ThreadPool::ThreadPool(int threads)
    : threads_(threads > 0 ? threads : available_threads()),
      // oneTBB takes the smallest of all limits that exist, for all pools: so only pools that need
      // more threads than cores set one.
      limit_(threads_ > tbb::this_task_arena::max_concurrency() ? std::make_unique<Limit>(threads_)
                                                                : nullptr),
      arena_(std::make_unique<tbb::task_arena>(threads_)) {}

ThreadPool::~ThreadPool() = default;

int available_threads() { return std::min(affinity_threads(), cgroup_threads()); }

}  // namespace piecework
