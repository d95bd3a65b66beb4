#pragma once

// Wall-clock stopwatch for phase times. Times are reported, never used to decide anything.

#include <chrono>

namespace piecework {

/// Milliseconds since construction or the last lap().
class Stopwatch {
 public:
  /// Milliseconds since construction or the last lap(), without restarting.
  [[nodiscard]] double elapsed_ms() const { return ms(Clock::now() - start_); }

  /// Milliseconds since construction or the last lap(); restarts the watch.
  double lap() {
    const auto now = Clock::now();
    const double result = ms(now - start_);
    start_ = now;
    return result;
  }

 private:
  using Clock = std::chrono::steady_clock;
  static double ms(Clock::duration d) {
    return std::chrono::duration<double, std::milli>(d).count();
  }
  Clock::time_point start_ = Clock::now();
};

}  // namespace piecework
