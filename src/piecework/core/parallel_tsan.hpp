#pragma once

// Loops of core/parallel.hpp for builds with the thread sanitizer. Debian's oneTBB is not
// instrumented, so that the sanitizer cannot see its hand-over of work and reports every task;
// plain threads that are started and joined it understands, and races of loop bodies show. Blocks
// and the order of sums are those of oneTBB's simple_partitioner.

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

#include <tbb/task_arena.h>

namespace piecework::tsan {

using Range = std::pair<std::size_t, std::size_t>;

/// Leaves of the halving of [begin, end) into ranges of at most `grain`, from left to right.
inline void split(std::size_t begin, std::size_t end, std::size_t grain, std::vector<Range>& out) {
  if (end - begin <= grain) {
    out.emplace_back(begin, end);
    return;
  }
  const std::size_t middle = begin + (end - begin) / 2;
  split(begin, middle, grain, out);
  split(middle, end, grain, out);
}

/// Calls work(k) for k in [0, count) on as many threads as the arena has; inside of such a call,
/// on the calling thread. Rethrows the exception of the first k that threw.
template <class Work>
void run_on_threads(std::size_t count, const Work& work) {
  static thread_local bool inside = false;
  const auto threads = std::min<std::size_t>(
      count, static_cast<std::size_t>(std::max(1, tbb::this_task_arena::max_concurrency())));
  std::vector<std::exception_ptr> errors(count);
  std::atomic<std::size_t> next{0};
  const auto loop = [&] {
    const bool outer = std::exchange(inside, true);
    for (std::size_t k = next++; k < count; k = next++) {
      try {
        work(k);
      } catch (...) {
        errors[k] = std::current_exception();
      }
    }
    inside = outer;
  };
  std::vector<std::thread> helpers;
  if (!inside)
    for (std::size_t i = 1; i < threads; ++i) helpers.emplace_back(loop);
  loop();
  for (std::thread& helper : helpers) helper.join();
  for (const std::exception_ptr& error : errors)
    if (error) std::rethrow_exception(error);
}

template <class Body>
void parallel_for(std::size_t count, const Body& body, std::size_t grain) {
  if (count == 0) return;
  std::vector<Range> ranges;
  split(0, count, grain, ranges);
  run_on_threads(ranges.size(), [&](std::size_t k) {
    for (std::size_t i = ranges[k].first; i != ranges[k].second; ++i) body(i);
  });
}

/// Joins the values of [begin, end) as split() halved it; `leaf` is the next leaf to take.
template <class T, class Join>
T join_tree(std::size_t begin, std::size_t end, std::size_t grain, std::vector<T>& values,
            std::size_t& leaf, const Join& join) {
  if (end - begin <= grain) return std::move(values[leaf++]);
  const std::size_t middle = begin + (end - begin) / 2;
  T left = join_tree(begin, middle, grain, values, leaf, join);
  const T right = join_tree(middle, end, grain, values, leaf, join);
  return join(std::move(left), right);
}

template <class T, class Block, class Join>
T parallel_reduce(std::size_t count, const T& identity, const Block& block, const Join& join,
                  std::size_t grain) {
  if (count == 0) return identity;
  std::vector<Range> ranges;
  split(0, count, grain, ranges);
  std::vector<T> values(ranges.size(), identity);
  run_on_threads(ranges.size(), [&](std::size_t k) {
    values[k] = block(ranges[k].first, ranges[k].second, identity);
  });
  std::size_t leaf = 0;
  return join_tree(0, count, grain, values, leaf, join);
}

}  // namespace piecework::tsan
