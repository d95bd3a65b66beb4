#include <piecework/core/parallel.hpp>

#include <atomic>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include <piecework/core/parallel_tsan.hpp>
#include <piecework/core/random.hpp>

namespace piecework {
namespace {

std::vector<double> random_terms(std::size_t count) {
  Random random(3);
  std::vector<double> terms(count);
  for (double& term : terms)
    term = random.uniform(-1.0, 1.0) * std::pow(10.0, random.uniform(-8, 8));
  return terms;
}

// The terms differ so much in size that a sum in another order has other bits: checked first.
TEST(Parallel, SumHasTheSameBitsForEveryThreadCount) {
  const std::vector<double> terms = random_terms(100'000);
  const auto sum_on = [&](int threads) {
    return ThreadPool(threads).run([&] {
      return parallel_sum<double>(terms.size(), [&](std::size_t i) { return terms[i]; });
    });
  };
  double forward = 0;
  for (double term : terms) forward += term;
  const double expected = sum_on(1);
  ASSERT_NE(forward, expected) << "the data cannot show a difference";
  EXPECT_NEAR(forward, expected, 1e-6 * std::abs(expected) + 1e-3);
  for (int threads : {2, 3, 8, 8, 8}) EXPECT_EQ(sum_on(threads), expected) << threads;
}

// The thread-sanitizer build swaps oneTBB for plain threads; it must not change a bit.
TEST(Parallel, SanitizerLoopsHaveTheSameBits) {
  const std::vector<double> terms = random_terms(100'003);
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{513}, terms.size()}) {
    const double plain = tsan::parallel_reduce(
        count, 0.0,
        [&](std::size_t begin, std::size_t end, double sum) {
          for (std::size_t i = begin; i != end; ++i) sum += terms[i];
          return sum;
        },
        [](double left, double right) { return left + right; }, kParallelGrain);
    EXPECT_EQ(plain, parallel_sum<double>(count, [&](std::size_t i) { return terms[i]; })) << count;
  }
}

TEST(Parallel, ForVisitsEveryItemOnce) {
  std::vector<std::atomic<int>> visits(5000);
  ThreadPool(4).run([&] {
    parallel_for(
        visits.size(), [&](std::size_t i) { ++visits[i]; }, 7);
  });
  for (const auto& visit : visits) EXPECT_EQ(visit, 1);
}

TEST(Parallel, EmptyRangesAreFine) {
  parallel_for(0, [](std::size_t) { FAIL(); });
  EXPECT_EQ(parallel_sum<double>(0, [](std::size_t) { return 1.0; }), 0.0);
  EXPECT_EQ(parallel_max(0, [](std::size_t) { return 1.0; }), 0.0);
}

TEST(Parallel, MaximumDoesNotHideNan) {
  std::vector<double> values(2000, 1.0);
  values[1234] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(parallel_max(
      values.size(), [&](std::size_t i) { return values[i]; }, 16)));
}

TEST(ThreadPool, MayHaveMoreThreadsThanCores) {
  ThreadPool pool(6);
  EXPECT_EQ(pool.threads(), 6);
  EXPECT_EQ(pool.run([] { return tbb::this_task_arena::max_concurrency(); }), 6);
}

TEST(ThreadPool, ZeroMeansTheMachine) { EXPECT_EQ(ThreadPool(0).threads(), available_threads()); }

}  // namespace
}  // namespace piecework
