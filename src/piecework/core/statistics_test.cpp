#include <piecework/core/statistics.hpp>

#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>

namespace piecework {
namespace {

// Oracle: the sign of (sample - median) is a fair coin, so count all 2^n outcomes in which fewer
// than r samples lie below it, or fewer than r above.
double miss_probability(unsigned n, unsigned r) {
  unsigned misses = 0;
  for (unsigned outcome = 0; outcome < (1U << n); ++outcome) {
    const auto below = static_cast<unsigned>(std::popcount(outcome));
    misses += (below < r || n - below < r) ? 1U : 0U;
  }
  return static_cast<double>(misses) / static_cast<double>(1U << n);
}

TEST(MedianInterval, RankIsTheLargestThatHolds95Percent) {
  for (unsigned n = 1; n <= 16; ++n) {
    const auto rank = static_cast<unsigned>(median_interval_rank(n));
    SCOPED_TRACE(n);
    if (rank > 0) {
      EXPECT_LE(miss_probability(n, rank), 0.05);
    }
    if (2 * (rank + 1) <= n) {
      EXPECT_GT(miss_probability(n, rank + 1), 0.05);
    }
  }
}

TEST(MedianInterval, RankMatchesThePublishedTableOfTheSignTest) {
  const std::map<std::size_t, std::size_t> table = {{5, 0},  {6, 1},   {8, 1},   {9, 2},   {12, 3},
                                                    {20, 6}, {30, 10}, {50, 18}, {100, 40}};
  for (const auto& [n, rank] : table) EXPECT_EQ(median_interval_rank(n), rank) << n;
}

TEST(MedianInterval, OfNumbersByHand) {
  const MedianInterval odd = median_interval({9, 1, 8, 2, 7, 3, 100, 4, 5});
  EXPECT_EQ(odd.median, 5);
  EXPECT_EQ(odd.low, 2);   // second smallest of 9
  EXPECT_EQ(odd.high, 9);  // second largest: the outlier 100 is not in
  EXPECT_EQ(odd.count, 9U);
  const MedianInterval even = median_interval({6, 5, 4, 3, 2, 1});
  EXPECT_EQ(even.median, 3.5);
  EXPECT_EQ(even.low, 1);
  EXPECT_EQ(even.high, 6);
}

TEST(MedianInterval, FewSamplesHaveNoInterval) {
  EXPECT_TRUE(std::isnan(median_interval({}).median));
  const MedianInterval five = median_interval({5, 5, 5, 5, 5});
  EXPECT_EQ(five.median, 5);
  EXPECT_EQ(five.low, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(five.high, std::numeric_limits<double>::infinity());
}

// Skewed samples (exponential, median ln 2), as times are.
TEST(MedianInterval, HoldsTheTrueMedianOfSkewedSamples) {
  Random random(11);
  constexpr int kRounds = 4000;
  int held = 0;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> samples(15);
    for (double& sample : samples) sample = -std::log(1.0 - random.uniform());
    const MedianInterval interval = median_interval(samples);
    held += (interval.low <= std::log(2.0) && std::log(2.0) <= interval.high) ? 1 : 0;
  }
  // The exact probability for n = 15 is 0.9648; 4 standard errors are 0.012.
  EXPECT_NEAR(static_cast<double>(held) / kRounds, 0.9648, 0.012);
}

}  // namespace
}  // namespace piecework
