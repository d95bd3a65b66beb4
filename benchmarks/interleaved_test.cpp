#include "interleaved.hpp"

#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

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

TEST(InterleavedTimer, SwapsTheOrderFromPairToPair) {
  FakeTimer timer;
  std::string order;
  for (int i = 0; i < 3; ++i) timer.sample([&] { order += 'a'; }, [&] { order += 'b'; });
  EXPECT_EQ(order, "abbaab");
}

TEST(InterleavedTimer, WarmsUpBeforeEachTimedCallInARow) {
  FakeTimer timer;
  std::string order;
  for (int i = 0; i < 2; ++i)
    timer.sample_in_a_row(
        [&] {
          order += 'a';
          FakeClock::pass(static_cast<double>(order.size()), 0);
        },
        [&] { order += 'b'; });
  EXPECT_EQ(order, "aabbbbaa");
  EXPECT_DOUBLE_EQ(timer.last_a(), 8) << "the first call of the two is not timed";
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
