#include "exact_meeting.hpp"

#include <cmath>

#include <gmpxx.h>

namespace piecework::collision {
namespace {

/// A vector of rational numbers.
using Exact = std::array<mpq_class, 3>;

Exact exact(const Vec3& x) { return {mpq_class(x[0]), mpq_class(x[1]), mpq_class(x[2])}; }

Exact operator-(const Exact& a, const Exact& b) {
  return {mpq_class(a[0] - b[0]), mpq_class(a[1] - b[1]), mpq_class(a[2] - b[2])};
}

mpq_class dot(const Exact& a, const Exact& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Exact cross(const Exact& a, const Exact& b) {
  return {mpq_class(a[1] * b[2] - a[2] * b[1]), mpq_class(a[2] * b[0] - a[0] * b[2]),
          mpq_class(a[0] * b[1] - a[1] * b[0])};
}

bool is_zero(const Exact& a) { return a[0] == 0 && a[1] == 0 && a[2] == 0; }

/// Products of smaller numbers than this may have lost bits at the lower end of double's range.
constexpr double kUnderflow = 1e-290;
constexpr double kUnit = 0x1.0p-53;  // relative rounding error of one operation

/// Sign of a determinant known up to `error`; 0 if that leaves it open.
int certain_sign(double determinant, double error) {
  if (determinant > error) return 1;
  return -determinant > error ? -1 : 0;
}

/// The sign of orientation(), or 0 if floating point cannot tell.
int likely_orientation(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const Vec3 u = b - a, v = c - a, w = d - a;
  const double vw = v[1] * w[2], wv = v[2] * w[1], wu = w[1] * u[2], uw = w[2] * u[1],
               uv = u[1] * v[2], vu = u[2] * v[1];
  const double determinant = u[0] * (vw - wv) + v[0] * (wu - uw) + w[0] * (uv - vu);
  const double permanent = std::abs(u[0]) * (std::abs(vw) + std::abs(wv)) +
                           std::abs(v[0]) * (std::abs(wu) + std::abs(uw)) +
                           std::abs(w[0]) * (std::abs(uv) + std::abs(vu));
  return certain_sign(determinant, (7 + 56 * kUnit) * kUnit * permanent + kUnderflow);
}

/// Side of line a b on which c lies, seen along a coordinate axis; 0 if floating point cannot tell.
int likely_side(const Vec3& a, const Vec3& b, const Vec3& c, Eigen::Index i, Eigen::Index j) {
  const double left = (a[i] - c[i]) * (b[j] - c[j]), right = (a[j] - c[j]) * (b[i] - c[i]);
  const double size = std::abs(left) + std::abs(right);
  return certain_sign(left - right, (3 + 16 * kUnit) * kUnit * size + kUnderflow);
}

/// True if, seen along one of the axes, a line along one of the four edges certainly separates
/// them. It need not notice every case; it spares most flat ones the rational numbers.
bool certainly_apart(const Segment& s, const Corners& t) {
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Index j = (i + 1) % 3;
    const int across = likely_side(s[0], s[1], t[0], i, j);
    if (across != 0 && across == likely_side(s[0], s[1], t[1], i, j) &&
        across == likely_side(s[0], s[1], t[2], i, j))
      return true;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 &a = t[k], &b = t[(k + 1) % 3], &c = t[(k + 2) % 3];
      const int inside = likely_side(a, b, c, i, j);
      if (inside != 0 && inside == -likely_side(a, b, s[0], i, j) &&
          inside == -likely_side(a, b, s[1], i, j))
        return true;
    }
  }
  return false;
}

bool within(const mpq_class& number, const mpq_class& end) { return number >= 0 && number <= end; }

bool point_on_segment(const Exact& x, const Exact& a, const Exact& b) {
  const Exact v = b - a, w = x - a;
  if (is_zero(v)) return is_zero(w);
  return is_zero(cross(w, v)) && within(dot(w, v), dot(v, v));
}

/// Closed segments p q and a b in space.
bool segments_meet(const Exact& p, const Exact& q, const Exact& a, const Exact& b) {
  const Exact u = q - p, v = b - a, w = a - p, n = cross(u, v);
  if (is_zero(n))  // parallel, or one is a point: if they meet, one has an end on the other
    return point_on_segment(p, a, b) || point_on_segment(q, a, b) || point_on_segment(a, p, q) ||
           point_on_segment(b, p, q);
  if (dot(w, n) != 0) return false;
  const mpq_class nn = dot(n, n);
  return within(dot(cross(w, v), n), nn) && within(dot(cross(w, u), n), nn);
}

/// x is in the plane of the triangle, which is no segment.
bool point_in_triangle(const Exact& x, const std::array<Exact, 3>& t, const Exact& normal) {
  for (std::size_t k = 0; k < 3; ++k)
    if (dot(cross(t[(k + 1) % 3] - t[k], x - t[k]), normal) < 0) return false;
  return true;
}

/// Segment in the plane of the triangle, or triangle degenerate.
bool meet_in_plane(const Segment& segment, const Corners& triangle) {
  const Exact p = exact(segment[0]), q = exact(segment[1]);
  const std::array<Exact, 3> t{exact(triangle[0]), exact(triangle[1]), exact(triangle[2])};
  for (std::size_t k = 0; k < 3; ++k)
    if (segments_meet(p, q, t[k], t[(k + 1) % 3])) return true;
  const Exact normal = cross(t[1] - t[0], t[2] - t[0]);
  return !is_zero(normal) && point_in_triangle(p, t, normal);
}

}  // namespace

int orientation(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const int sign = likely_orientation(a, b, c, d);
  if (sign != 0) return sign;
  const Exact origin = exact(a);
  return sgn(dot(exact(b) - origin, cross(exact(c) - origin, exact(d) - origin)));
}

bool meet(const Segment& s, const Corners& t) {
  // Before anything exact: two ends on one side, or all of it apart in the plane.
  const int certain_p = likely_orientation(t[0], t[1], t[2], s[0]);
  const int certain_q = likely_orientation(t[0], t[1], t[2], s[1]);
  if (certain_p * certain_q > 0 || certainly_apart(s, t)) return false;

  const int side_p = orientation(t[0], t[1], t[2], s[0]);
  const int side_q = orientation(t[0], t[1], t[2], s[1]);
  if (side_p * side_q > 0) return false;
  if (side_p == 0 && side_q == 0) return meet_in_plane(s, t);
  // The line crosses the plane in one point; it is inside if no two edges see the line turn
  // different ways.
  bool positive = false, negative = false;
  for (std::size_t k = 0; k < 3; ++k) {
    const int turn = orientation(s[0], s[1], t[k], t[(k + 1) % 3]);
    positive |= turn > 0;
    negative |= turn < 0;
  }
  return !(positive && negative);
}

}  // namespace piecework::collision
