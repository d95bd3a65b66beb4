#include <piecework/core/statistics.hpp>

#include <algorithm>
#include <cmath>

namespace piecework {

std::size_t median_interval_rank(std::size_t n) {
  const auto count = static_cast<double>(n);
  double tail = 0;  // P(Binomial < rank + 1)
  std::size_t rank = 0;
  for (;; ++rank) {
    const auto k = static_cast<double>(rank);
    tail += std::exp(std::lgamma(count + 1) - std::lgamma(k + 1) - std::lgamma(count - k + 1) -
                     count * std::log(2.0));
    if (2 * tail > 0.05 || 2 * (rank + 1) > n) return rank;
  }
}

MedianInterval median_interval(std::vector<double> samples) {
  MedianInterval result;
  const std::size_t n = samples.size();
  result.count = n;
  if (n == 0) return result;
  std::sort(samples.begin(), samples.end());
  result.median = 0.5 * (samples[(n - 1) / 2] + samples[n / 2]);
  const std::size_t rank = median_interval_rank(n);
  if (n >= kMinSamplesForInterval && rank > 0) {
    result.low = samples[rank - 1];
    result.high = samples[n - rank];
  }
  return result;
}

}  // namespace piecework
