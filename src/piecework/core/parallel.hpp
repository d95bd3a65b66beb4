#pragma once

// The one door to oneTBB. Every parallel loop and reduction of Piecework goes through here, so
// that thread limits, deterministic summation and sanitizer annotations live in one place.
// Results never depend on the number of threads: loops write disjoint data, and sums are taken
// over fixed blocks in a fixed order.

#include <cstddef>
#include <memory>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <tbb/task_arena.h>

#ifdef __SANITIZE_THREAD__
#include <piecework/core/parallel_tsan.hpp>
#endif

namespace piecework {

/// Items per task in loops over vertices or elements; also the block size of fixed-order sums.
inline constexpr std::size_t kParallelGrain = 512;

/// Calls body(i) for i in [0, count); calls for different i may run at the same time.
template <class Body>
void parallel_for(std::size_t count, const Body& body, std::size_t grain = kParallelGrain) {
#ifdef __SANITIZE_THREAD__
  tsan::parallel_for(count, body, grain);
#else
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, grain),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
      },
      tbb::simple_partitioner());
#endif
}

/// The reduction behind parallel_sum() and parallel_max(): fixed blocks, joined in a fixed tree.
template <class T, class Block, class Join>
T parallel_reduce_blocks(std::size_t count, const T& identity, const Block& block, const Join& join,
                         std::size_t grain) {
#ifdef __SANITIZE_THREAD__
  return tsan::parallel_reduce(count, identity, block, join, grain);
#else
  return tbb::parallel_deterministic_reduce(
      tbb::blocked_range<std::size_t>(0, count, grain), identity,
      [&](const tbb::blocked_range<std::size_t>& range, T value) {
        return block(range.begin(), range.end(), std::move(value));
      },
      join, tbb::simple_partitioner());
#endif
}

/// Sum of term(i) for i in [0, count), in an order that depends on count and grain only.
/// T is double or any type with T{} == 0 and operator+=.
template <class T, class Term>
T parallel_sum(std::size_t count, const Term& term, std::size_t grain = kParallelGrain) {
  return parallel_reduce_blocks(
      count, T{},
      [&](std::size_t begin, std::size_t end, T sum) {
        for (std::size_t i = begin; i != end; ++i) sum += term(i);
        return sum;
      },
      [](T left, const T& right) {
        left += right;
        return left;
      },
      grain);
}

/// Maximum of term(i) for i in [0, count), at least 0. A NaN term makes the result NaN.
template <class Term>
double parallel_max(std::size_t count, const Term& term, std::size_t grain = kParallelGrain) {
  const auto larger = [](double a, double b) { return (b > a || b != b) ? b : a; };
  return parallel_reduce_blocks(
      count, 0.0,
      [&](std::size_t begin, std::size_t end, double best) {
        for (std::size_t i = begin; i != end; ++i) best = larger(best, term(i));
        return best;
      },
      larger, grain);
}

/// A fixed number of threads for everything called through run(). More threads than cores are
/// allowed (tests use that to show that results do not depend on the number).
class ThreadPool {
 public:
  /// \param threads  at least 1; 0 means available_threads().
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  [[nodiscard]] int threads() const { return threads_; }

  /// Runs `body` with its parallel loops spread over this pool and returns its result.
  template <class Body>
  auto run(const Body& body) {
    return arena_->execute(body);
  }

 private:
  struct Limit;
  int threads_;
  std::unique_ptr<Limit> limit_;
  std::unique_ptr<tbb::task_arena> arena_;
};

/// Threads this process may use: the smaller of its CPU affinity and its cgroup CPU quota.
int available_threads();

}  // namespace piecework
