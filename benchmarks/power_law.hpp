#pragma once

// How a cost grows: the exponent of a power law through measured points.

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

namespace piecework::bench {

/// Least-squares slope of log y over log x; points without a logarithm are left out. NaN without
/// two different x.
inline double power_exponent(std::span<const double> x, std::span<const double> y) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t i = 0; i < x.size() && i < y.size(); ++i) {
    if (!(x[i] > 0) || !(y[i] > 0)) continue;
    const double a = std::log(x[i]), b = std::log(y[i]);
    n += 1, sx += a, sy += b, sxx += a * a, sxy += a * b;
  }
  const double spread = n * sxx - sx * sx;
  if (!(spread > 1e-12 * n * sxx)) return std::numeric_limits<double>::quiet_NaN();
  return (n * sxy - sx * sy) / spread;
}

}  // namespace piecework::bench
