#pragma once

// Comparing two pieces of code on a machine that other work disturbs: they are timed alternately
// inside one loop, so that both see the same disturbance, and judged by medians with intervals
// from order statistics. Never the best run alone, never mean +- deviation of skewed times.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <piecework/core/statistics.hpp>

namespace piecework::bench {

/// Shortest call, s, whose processor time means something: the kernel brings the clocks of a
/// process's other threads up to date once a tick (up to 10 ms), so that shorter calls get the
/// time of their neighbours (seen here: 2.9 "busy threads" in a plain loop).
inline constexpr double kMinSecondsForCpuTime = 0.02;

/// Wall and processor time of this process (all threads), s.
struct ProcessClock {
  static double wall() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
  static double cpu() {
    std::timespec t{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  }
};

/// Times A and B in the order A B, B A, A B, ... and keeps every sample. Single-threaded use; A
/// and B themselves may use threads. In a benchmark:
///
///     InterleavedTimer timer;
///     for (auto _ : state) {
///       timer.sample([&] { ours(); }, [&] { baseline(); });
///       state.SetIterationTime(timer.last_a());
///     }
///     timer.write(state.counters);   // register with ->UseManualTime()
///
/// One unmeasured call of both before the loop warms caches. Setup belongs outside of A and B.
/// Register slow benchmarks with ->Iterations(n), n >= 6: one iteration gives no interval.
template <class Clock>
class BasicInterleavedTimer {
 public:
  /// Times one call of each, swapping the order from call to call.
  template <class A, class B>
  void sample(A&& a, B&& b) {
    in_turns([&] { a_.time(a); }, [&] { b_.time(b); });
  }

  /// The same for code that in real use runs many times in a row: each timed call follows an
  /// untimed one of the same, so that neither pays for the caches that the other one emptied.
  template <class A, class B>
  void sample_in_a_row(A&& a, B&& b) {
    const auto warm = [](Series& series, auto& function) {
      function();
      series.time(function);
    };
    in_turns([&] { warm(a_, a); }, [&] { warm(b_, b); });
  }

  /// Seconds of the newest call of A; at least one sample must have been taken.
  [[nodiscard]] double last_a() const { return a_.wall.back(); }

  [[nodiscard]] MedianInterval a_seconds() const { return median_interval(a_.wall); }
  [[nodiscard]] MedianInterval b_seconds() const { return median_interval(b_.wall); }

  /// median(A) / median(B): below 1 where A is faster.
  [[nodiscard]] double ratio_of_medians() const { return a_seconds().median / b_seconds().median; }

  /// Median and interval of the ratios A / B of the single pairs. The two of a pair ran next to
  /// each other, so slow disturbance cancels; a gate looks at `low`.
  [[nodiscard]] MedianInterval paired_ratio() const {
    std::vector<double> ratios(a_.wall.size());
    std::transform(a_.wall.begin(), a_.wall.end(), b_.wall.begin(), ratios.begin(),
                   [](double a, double b) { return a / b; });
    return median_interval(std::move(ratios));
  }

  /// Processor time / wall time: the number of busy threads. Well below the threads in use, the
  /// samples were disturbed by other work or waited. See kMinSecondsForCpuTime.
  [[nodiscard]] double a_cpu_per_wall() const { return a_.cpu_seconds / a_.wall_seconds; }
  [[nodiscard]] double b_cpu_per_wall() const { return b_.cpu_seconds / b_.wall_seconds; }

  /// Writes all of the above to a map of names to numbers, times in ms: benchmark::UserCounters.
  /// What has no meaning is left out: intervals of n < 6, processor times of short calls.
  template <class Counters>
  void write(Counters& counters) const {
    write_interval(counters, "ours_ms", a_seconds(), 1e3);
    write_interval(counters, "base_ms", b_seconds(), 1e3);
    write_interval(counters, "paired_ratio", paired_ratio(), 1.0);
    counters["ratio"] = ratio_of_medians();
    counters["n"] = static_cast<double>(a_.wall.size());
    if (std::min(a_seconds().median, b_seconds().median) < kMinSecondsForCpuTime) return;
    counters["ours_cpu_per_wall"] = a_cpu_per_wall();
    counters["base_cpu_per_wall"] = b_cpu_per_wall();
  }

 private:
  struct Series {
    std::vector<double> wall;
    double wall_seconds = 0;
    double cpu_seconds = 0;

    template <class Function>
    void time(Function& function) {
      const double cpu = Clock::cpu();
      const double start = Clock::wall();
      function();
      wall.push_back(Clock::wall() - start);
      wall_seconds += wall.back();
      cpu_seconds += Clock::cpu() - cpu;
    }
  };

  template <class First, class Second>
  void in_turns(const First& time_a, const Second& time_b) {
    const bool a_first = a_.wall.size() % 2 == 0;
    if (a_first) time_a();
    time_b();
    if (!a_first) time_a();
  }

  template <class Counters>
  static void write_interval(Counters& counters, const char* name, const MedianInterval& interval,
                             double scale) {
    const std::string prefix(name);
    counters[prefix] = scale * interval.median;
    if (interval.count < kMinSamplesForInterval) return;
    counters[prefix + "_low"] = scale * interval.low;
    counters[prefix + "_high"] = scale * interval.high;
  }

  Series a_;
  Series b_;
};

using InterleavedTimer = BasicInterleavedTimer<ProcessClock>;

}  // namespace piecework::bench
