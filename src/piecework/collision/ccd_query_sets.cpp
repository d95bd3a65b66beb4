#include <piecework/collision/ccd_query_sets.hpp>

#include <cmath>

#include <piecework/core/random.hpp>

namespace piecework::collision {
namespace {

using Points = PairPoints;

Vec3 anywhere(Random& r) { return {r.uniform(-1, 1), r.uniform(-1, 1), r.uniform(-1, 1)}; }

Points four_points(Random& r) { return {anywhere(r), anywhere(r), anywhere(r), anywhere(r)}; }

/// 10^u, u uniform.
double power(Random& r, double low, double high) { return std::pow(10.0, r.uniform(low, high)); }

int integer(Random& r, int low, int high) {
  return low + static_cast<int>(r.uniform() * (high - low + 1));
}

/// A moving pair whose elements meet at `time` in their insides, `gap` apart along their normal and
/// with that relative speed along it.
struct Meeting {
  double size, time, gap, normal_speed, speed;
};

CcdQuery meet(PairKind kind, Random& r, const Meeting& m) {
  Points x = four_points(r), v;
  for (Vec3& p : x) p *= m.size;
  for (Vec3& p : v) p = m.speed * anywhere(r);
  // Coefficients of the offset between the points that meet, as in distance.hpp.
  const double s = r.uniform(), u = r.uniform() * (kind == PairKind::VertexTriangle ? 1 - s : 1);
  std::array<double, 4> beta{1, -(1 - s - u), -s, -u};
  if (kind == PairKind::EdgeEdge) beta = {1 - s, s, -(1 - u), -u};
  Vec3 offset = Vec3::Zero(), velocity = Vec3::Zero();
  for (std::size_t i = 0; i < 4; ++i) offset += beta[i] * x[i], velocity += beta[i] * v[i];
  const Vec3 normal = kind == PairKind::VertexTriangle
                          ? (x[2] - x[1]).cross(x[3] - x[1]).normalized().eval()
                          : (x[1] - x[0]).cross(x[3] - x[2]).normalized().eval();
  const std::size_t moved = kind == PairKind::VertexTriangle ? 1 : 2;
  for (std::size_t i = 0; i < moved; ++i) {
    x[i] += m.gap * normal - offset;
    v[i] += (m.normal_speed - velocity.dot(normal)) * normal;
  }
  CcdQuery q{kind, x, x};
  for (std::size_t i = 0; i < 4; ++i) q.start[i] -= m.time * v[i], q.end[i] += (1 - m.time) * v[i];
  return q;
}

CcdQuery candidates(PairKind kind, Random& r) {
  CcdQuery q{kind, four_points(r), {}};
  for (std::size_t i = 0; i < 4; ++i) {
    q.start[i] *= 0.005;
    q.end[i] = q.start[i] + 0.001 * anywhere(r);
  }
  return q;
}

CcdQuery cloth(PairKind kind, Random& r) {
  const double gap = r.uniform(1e-4, 2e-3), approach = r.uniform(-2e-3, 6e-3);
  return meet(kind, r, {0.01, 0, gap, -approach, 5e-4});
}

CcdQuery near_coplanar(PairKind kind, Random& r) {
  CcdQuery q{kind, four_points(r), four_points(r)};
  const double thickness = power(r, -10, -2);
  for (Points* side : {&q.start, &q.end})
    for (Vec3& p : *side) p.z() *= thickness;
  return q;
}

CcdQuery double_root(PairKind kind, Random& r) {
  const double miss = integer(r, 0, 2) == 0 ? 0 : power(r, -17, -4) * (r.uniform() < 0.5 ? -1 : 1);
  return meet(kind, r, {1, r.uniform(0.1, 0.9), miss, 0, 1});
}

CcdQuery small_integers(PairKind kind, Random& r) {
  CcdQuery q{kind, {}, {}};
  for (Points* side : {&q.start, &q.end})
    for (Vec3& p : *side) p = Vec3(integer(r, -2, 2), integer(r, -2, 2), integer(r, -2, 2));
  return q;
}

/// Exact dyadic numbers, so that degenerate elements really meet, then perhaps disturbed.
CcdQuery parallel(PairKind kind, Random& r) {
  CcdQuery q{kind, {}, {}};
  const auto whole = [&r] { return Vec3(integer(r, -2, 2), integer(r, -2, 2), integer(r, -2, 2)); };
  const Vec3 along = whole(), target = whole(), from = whole(), to = target - (from - target);
  for (Points* side : {&q.start, &q.end}) {
    const Vec3& place = side == &q.start ? from : to;
    const double a = 0.25 * integer(r, -4, 4), b = 0.25 * integer(r, -4, 4);
    if (kind == PairKind::VertexTriangle)
      *side = {place, target - along, target + a * along, target + along};
    else
      *side = {place + a * along, place + along, target - along, target + b * along};
  }
  if (integer(r, 0, 1) == 0) return q;
  const double noise = power(r, -16, -6);
  for (Points* side : {&q.start, &q.end})
    for (Vec3& p : *side) p += noise * anywhere(r);
  return q;
}

/// Half of them aimed at each other.
CcdQuery zero_length(PairKind kind, Random& r) {
  CcdQuery q = small_integers(kind, r);
  const bool both = integer(r, 0, 1) == 0, aimed = integer(r, 0, 1) == 0;
  const double split = integer(r, 0, 2) == 0 ? power(r, -16, -6) : 0;
  if (aimed) q.end[0] = q.start[2] + q.end[2] - q.start[0];  // x0 and x2 meet at 1/2
  for (Points* side : {&q.start, &q.end}) {
    Points& x = *side;
    x[3] = x[2] + split * anywhere(r);
    if (both) x[1] = kind == PairKind::EdgeEdge ? x[0] : x[2];
  }
  return q;
}

CcdQuery far(PairKind kind, Random& r) {
  CcdQuery q = r.uniform() < 0.5 ? cloth(kind, r) : CcdQuery{kind, four_points(r), four_points(r)};
  const double distance = power(r, 4, 9);
  for (Points* side : {&q.start, &q.end}) {
    const Vec3 by = distance * anywhere(r);
    for (Vec3& p : *side) p += by;
  }
  return q;
}

CcdQuery scales(PairKind kind, Random& r) {
  CcdQuery q{kind, four_points(r), four_points(r)};
  const double scale = power(r, -6, 6);
  for (Points* side : {&q.start, &q.end})
    for (Vec3& p : *side) p *= scale;
  return q;
}

CcdQuery fast(PairKind kind, Random& r) {
  const double speed = 0.01 * power(r, 2, 4);
  CcdQuery q = meet(kind, r, {0.01, r.uniform(), 0, r.uniform(-speed, speed), 0.01});
  const Vec3 common = speed * anywhere(r);
  for (Vec3& p : q.end) p += common;
  if (r.uniform() < 0.5) return q;
  const Vec3 aside = 0.02 * anywhere(r);
  const std::size_t moved = kind == PairKind::VertexTriangle ? 1 : 2;
  for (std::size_t i = 0; i < moved; ++i) q.start[i] += aside, q.end[i] += aside;
  return q;
}

}  // namespace

CcdQuery make_query(QuerySet set, std::uint64_t index) {
  Random r(1000003 * (index + 1) + static_cast<std::uint64_t>(set));
  const PairKind kind = index % 2 == 0 ? PairKind::VertexTriangle : PairKind::EdgeEdge;
  switch (set) {
    case QuerySet::Candidates:
      return candidates(kind, r);
    case QuerySet::Cloth:
      return cloth(kind, r);
    case QuerySet::NearCoplanar:
      return near_coplanar(kind, r);
    case QuerySet::DoubleRoot:
      return double_root(kind, r);
    case QuerySet::SmallIntegers:
      return small_integers(kind, r);
    case QuerySet::Parallel:
      return parallel(kind, r);
    case QuerySet::ZeroLength:
      return zero_length(kind, r);
    case QuerySet::Far:
      return far(kind, r);
    case QuerySet::Scales:
      return scales(kind, r);
    case QuerySet::Fast:
      return fast(kind, r);
    case QuerySet::Random:
      break;
  }
  return {kind, four_points(r), four_points(r)};
}

}  // namespace piecework::collision
