#include "interleaved.hpp"

#include <bit>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>

namespace piecework::bench {
namespace {

/// Time that passes only when a test says so.
struct FakeClock {
  static inline double wall_now = 0;
  static inline double cpu_now = 0;
  static double wall() { return wall_now; }
  static double cpu() { return cpu_now; }
  static void pass(double wall, double cpu) {
    wall_now += wall;
    cpu_now += cpu;
  }
};
using FakeTimer = BasicInterleavedTimer<FakeClock>;

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

TEST(InterleavedTimer, SwapsTheOrderFromPairToPair) {
  FakeTimer timer;
  std::string order;
  for (int i = 0; i < 3; ++i) timer.sample([&] { order += 'a'; }, [&] { order += 'b'; });
  EXPECT_EQ(order, "abbaab");
}

TEST(InterleavedTimer, KeepsEveryTimeWhereItBelongs) {
  FakeTimer timer;
  for (int i = 1; i <= 7; ++i) {
    timer.sample([&] { FakeClock::pass(2.0 * i, 3.0 * i); }, [&] { FakeClock::pass(8.0 * i, i); });
    EXPECT_DOUBLE_EQ(timer.last_a(), 2.0 * i);
  }
  EXPECT_DOUBLE_EQ(timer.a_seconds().median, 8.0);
  EXPECT_DOUBLE_EQ(timer.a_seconds().low, 2.0);
  EXPECT_DOUBLE_EQ(timer.b_seconds().median, 32.0);
  EXPECT_DOUBLE_EQ(timer.ratio_of_medians(), 0.25);
  EXPECT_DOUBLE_EQ(timer.a_cpu_per_wall(), 1.5);
  EXPECT_DOUBLE_EQ(timer.b_cpu_per_wall(), 0.125);
}

// The machine gets slower and slower by a factor of 1000: pairs are not fooled.
TEST(InterleavedTimer, PairedRatioIgnoresSlowDisturbance) {
  FakeTimer timer;
  for (int i = 0; i < 20; ++i) {
    const double slowness = std::pow(1000.0, i / 19.0);
    timer.sample([&] { FakeClock::pass(1.2 * slowness, 0); },
                 [&] { FakeClock::pass(1.0 * slowness, 0); });
  }
  ASSERT_GT(timer.a_seconds().high, 3 * timer.a_seconds().low) << "no disturbance was seeded";
  EXPECT_NEAR(timer.paired_ratio().median, 1.2, 1e-9);
  EXPECT_NEAR(timer.paired_ratio().low, 1.2, 1e-9);
  EXPECT_NEAR(timer.paired_ratio().high, 1.2, 1e-9);
}

/// Counters of `count` pairs in which A takes `seconds` and B twice that.
std::map<std::string, double> counters_of(int count, double seconds) {
  FakeTimer timer;
  for (int i = 0; i < count; ++i) {
    timer.sample([&] { FakeClock::pass(seconds, seconds); },
                 [&] { FakeClock::pass(2 * seconds, 2 * seconds); });
  }
  std::map<std::string, double> counters;
  timer.write(counters);
  return counters;
}

TEST(InterleavedTimer, WritesCountersInMilliseconds) {
  const auto counters = counters_of(6, 0.04);
  EXPECT_NEAR(counters.at("ours_ms"), 40.0, 1e-9);
  EXPECT_NEAR(counters.at("base_ms_high"), 80.0, 1e-9);
  EXPECT_NEAR(counters.at("ratio"), 0.5, 1e-9);
  EXPECT_NEAR(counters.at("paired_ratio_low"), 0.5, 1e-9);
  EXPECT_NEAR(counters.at("ours_cpu_per_wall"), 1.0, 1e-9);
  EXPECT_EQ(counters.at("n"), 6);
}

TEST(InterleavedTimer, LeavesOutWhatHasNoMeaning) {
  const auto few = counters_of(5, 0.04);
  EXPECT_EQ(few.count("ours_ms"), 1U);
  EXPECT_EQ(few.count("ours_ms_low"), 0U);
  const auto brief = counters_of(6, 0.001);
  EXPECT_EQ(brief.count("ours_ms_low"), 1U);
  EXPECT_EQ(brief.count("ours_cpu_per_wall"), 0U);
}

// The real clocks: busy work uses about one processor, sleeping uses none.
TEST(InterleavedTimer, TellsWorkFromWaiting) {
  InterleavedTimer timer;
  const auto work = [] {
    const double end = ProcessClock::cpu() + 0.005;
    while (ProcessClock::cpu() < end) {
    }
  };
  const auto wait = [] {
    const std::timespec pause{0, 5'000'000};
    ::nanosleep(&pause, nullptr);
  };
  for (int i = 0; i < 6; ++i) timer.sample(work, wait);
  EXPECT_GT(timer.a_cpu_per_wall(), 4 * timer.b_cpu_per_wall());
  EXPECT_GE(timer.a_seconds().low, 0.004);
  EXPECT_GE(timer.b_seconds().low, 0.005);
}

}  // namespace
}  // namespace piecework::bench
