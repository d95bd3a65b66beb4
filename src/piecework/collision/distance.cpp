#include <piecework/collision/distance.hpp>

#include <algorithm>

namespace piecework::collision {
namespace {

/// Of a squared sine: below this an angle is all rounding.
constexpr double kParallel = 1e-14;

Closest combination(const std::array<double, 4>& beta, const PairPoints& x) {
  // Differences first: exact where vertices are close, however far from the origin.
  const Vec3 offset = beta[1] * (x[1] - x[0]) + beta[2] * (x[2] - x[0]) + beta[3] * (x[3] - x[0]);
  return {beta, offset, offset.squaredNorm()};
}

/// Parameter of the point of segment a b closest to p, in [0, 1].
double closest_on_segment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 ab = b - a;
  const double length_sq = ab.squaredNorm();
  if (!(length_sq > 0)) return 0;
  return std::clamp(ab.dot(p - a) / length_sq, 0.0, 1.0);
}

/// The closest point is on the border of the triangle.
Closest closest_vertex_border(const PairPoints& x) {
  Closest best{};
  for (int k = 0; k < 3; ++k) {
    const int a = 1 + k, b = 1 + (k + 1) % 3;
    const double t =
        closest_on_segment(x[0], x[static_cast<std::size_t>(a)], x[static_cast<std::size_t>(b)]);
    std::array<double, 4> beta{1, 0, 0, 0};
    beta[static_cast<std::size_t>(a)] = -(1 - t);
    beta[static_cast<std::size_t>(b)] = -t;
    const Closest candidate = combination(beta, x);
    if (k == 0 || candidate.distance_sq < best.distance_sq) best = candidate;
  }
  return best;
}

}  // namespace

Closest closest_vertex_triangle(const PairPoints& x) {
  const Vec3 e1 = x[2] - x[1], e2 = x[3] - x[1], r = x[0] - x[1];
  const double a11 = e1.squaredNorm(), a12 = e1.dot(e2), a22 = e2.squaredNorm();
  const double r1 = e1.dot(r), r2 = e2.dot(r);
  const double det = a11 * a22 - a12 * a12;
  if (det > kParallel * a11 * a22) {
    const double b2 = (a22 * r1 - a12 * r2) / det, b3 = (a11 * r2 - a12 * r1) / det;
    const double b1 = 1 - b2 - b3;
    if (b1 >= 0 && b2 >= 0 && b3 >= 0) return combination({1, -b1, -b2, -b3}, x);
  }
  return closest_vertex_border(x);
}

/// Clamped coordinate descent: the distance is convex in (s, u), so after the interior minimum over
/// s is clamped, the best u for it, and the best s for that u clamped, it is at its minimum
/// [Ericson 2005, Sec. 5.1.9].
Closest closest_edge_edge(const PairPoints& x) {
  const Vec3 e = x[1] - x[0], f = x[3] - x[2], r = x[0] - x[2];
  const double a = e.squaredNorm(), b = e.dot(f), c = f.squaredNorm();
  const double d = e.dot(r), g = f.dot(r);
  const double det = a * c - b * b;
  // Parallel edges are as close everywhere along their overlap: any s will do to begin with.
  double s = det > kParallel * a * c ? std::clamp((b * g - c * d) / det, 0.0, 1.0) : 0.0;
  double u = c > 0 ? (b * s + g) / c : -1.0;
  if (!(u >= 0 && u <= 1)) {  // or the second edge is a point
    u = u > 1 ? 1.0 : 0.0;
    s = a > 0 ? std::clamp((b * u - d) / a, 0.0, 1.0) : 0.0;
  }
  return combination({1 - s, s, -(1 - u), -u}, x);
}

}  // namespace piecework::collision
