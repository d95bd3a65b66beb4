#pragma once

// Honest summaries of skewed samples: medians with intervals from order statistics. Never the best
// run alone, never mean +- deviation of times.

#include <cstddef>
#include <limits>
#include <vector>

namespace piecework {

/// Fewest samples that have an interval of 95 %: with 5, even [min, max] holds the median with
/// 1 - 2 * 0.5^5 = 93.8 % only.
inline constexpr std::size_t kMinSamplesForInterval = 6;

/// Median of n samples and the interval that holds the true median with at least 95 %.
struct MedianInterval {
  double median = std::numeric_limits<double>::quiet_NaN();  ///< NaN without samples
  double low = -std::numeric_limits<double>::infinity();     ///< -inf if n < 6
  double high = std::numeric_limits<double>::infinity();     ///< inf if n < 6
  std::size_t count = 0;
};

/// The largest r such that [r-th smallest, r-th largest] of n samples holds the median with at
/// least 95 %; 0 if there is none. The probability is 1 - 2 P(Binomial(n, 1/2) < r), whatever the
/// distribution of the samples.
std::size_t median_interval_rank(std::size_t n);

/// Median (mean of the middle two for even n) and its interval.
MedianInterval median_interval(std::vector<double> samples);

}  // namespace piecework
