#include <piecework/colliders/shapes.hpp>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::colliders {
namespace {

/// v / |v|, or `otherwise` if v is 0. Safe against under- and overflow of |v|^2.
Vec3 direction(const Vec3& v, const Vec3& otherwise) {
  const double length = v.stableNorm();
  return length > 0 ? Vec3(v / length) : otherwise;
}

/// A point in the coordinates of an axis: along it from the middle of two ends, and away from it.
struct Axial {
  Vec3 up;      ///< unit length; +y if the ends coincide
  double half;  ///< of the distance of the ends
  double along, away;
  Vec3 side;  ///< unit length, perpendicular to up, even where `away` is 0 but for rounding
};

Axial axial(const Vec3& from, const Vec3& to, const Vec3& p) {
  const Vec3 axis = to - from;
  const Vec3 up = direction(axis, Vec3::UnitY());
  const Vec3 u = up.unitOrthogonal();
  const Vec3 v = up.cross(u);
  const Vec3 local = p - 0.5 * (from + to);
  const Vec2 across(local.dot(u), local.dot(v));
  const double away = across.stableNorm();
  const Vec3 side = away > 0 ? Vec3(across.x() / away * u + across.y() / away * v) : u;
  return {up, 0.5 * axis.stableNorm(), local.dot(up), away, side};
}

SignedDistance distance_to(const Plane& plane, const Vec3& p) {
  const Vec3 normal = plane.normal.stableNormalized();
  return {normal.dot(p - plane.point), normal};
}

SignedDistance distance_to(const Sphere& sphere, const Vec3& p) {
  const Vec3 offset = p - sphere.center;
  return {offset.stableNorm() - sphere.radius, direction(offset, Vec3::UnitY())};
}

SignedDistance distance_to(const Capsule& capsule, const Vec3& p) {
  const Axial at = axial(capsule.from, capsule.to, p);
  const double beyond = at.along - std::clamp(at.along, -at.half, at.half);
  const Vec2 offset(at.away, beyond);
  const double length = offset.stableNorm();
  if (!(length > 0)) return {-capsule.radius, at.side};
  return {length - capsule.radius, (at.away * at.side + beyond * at.up) / length};
}

/// Distance from the box |q_i| <= 0 grown by `rounding`, in the octant of positive coordinates:
/// q are the distances beyond its faces. The normal is in that octant.
template <int N>
std::pair<double, Eigen::Matrix<double, N, 1>> octant_distance(const Eigen::Matrix<double, N, 1>& q,
                                                               double rounding) {
  const Eigen::Matrix<double, N, 1> outside = q.cwiseMax(0);
  const double length = outside.stableNorm();
  if (length > 0) return {length - rounding, outside / length};
  Eigen::Index nearest = 0;
  const double inside = q.maxCoeff(&nearest);
  return {inside - rounding, Eigen::Matrix<double, N, 1>::Unit(nearest)};
}

SignedDistance distance_to(const Box& box, const Vec3& p) {
  const Vec3 local = p - box.center;
  const Vec3 q = local.cwiseAbs() - (box.half_size.array() - box.rounding).matrix();
  const auto [distance, normal] = octant_distance<3>(q, box.rounding);
  const Vec3 sign = local.unaryExpr([](double x) { return x < 0 ? -1.0 : 1.0; });
  return {distance, normal.cwiseProduct(sign)};
}

SignedDistance distance_to(const Cylinder& cylinder, const Vec3& p) {
  const Axial at = axial(cylinder.from, cylinder.to, p);
  const Vec2 q(at.away - (cylinder.radius - cylinder.rounding),
               std::abs(at.along) - (at.half - cylinder.rounding));
  const auto [distance, normal] = octant_distance<2>(q, cylinder.rounding);
  return {distance, normal.x() * at.side + (at.along < 0 ? -normal.y() : normal.y()) * at.up};
}

SignedDistance distance_to(const HalfSpaces& solid, const Vec3& p) {
  return solid.signed_distance(p);
}

[[noreturn]] void fail(const std::string& name, const std::string& problem) {
  throw InputError(fmt::format("{}: {}", name, problem));
}

void check_finite(const std::string& name, const char* what, const Vec3& v) {
  if (!v.allFinite()) fail(name, fmt::format("{} is not finite; give three numbers", what));
}

void check_size(const std::string& name, const char* what, double size) {
  if (!std::isfinite(size) || !(size > 0))
    fail(name, fmt::format("{} is {} m; give a length above 0", what, size));
}

void check_rounding(const std::string& name, double rounding, double largest) {
  if (!(rounding >= 0 && rounding <= largest))
    fail(name, fmt::format("rounding is {} m; give 0 to {} m, half of the smallest extent",
                           rounding, largest));
}

struct Validator {
  const std::string& name;

  void operator()(const Plane& plane) const {
    check_finite(name, "point", plane.point);
    check_finite(name, "normal", plane.normal);
    if (plane.normal.isZero(0)) fail(name, "the normal has no direction; give one, as [0, 1, 0]");
  }
  void operator()(const Sphere& sphere) const {
    check_finite(name, "center", sphere.center);
    check_size(name, "radius", sphere.radius);
  }
  void operator()(const Capsule& capsule) const {
    check_finite(name, "from", capsule.from);
    check_finite(name, "to", capsule.to);
    check_size(name, "radius", capsule.radius);
  }
  void operator()(const Box& box) const {
    check_finite(name, "center", box.center);
    for (const double size : box.half_size) check_size(name, "half of the size", size);
    check_rounding(name, box.rounding, box.half_size.minCoeff());
  }
  void operator()(const Cylinder& cylinder) const {
    check_finite(name, "from", cylinder.from);
    check_finite(name, "to", cylinder.to);
    check_size(name, "radius", cylinder.radius);
    const double length = (cylinder.to - cylinder.from).stableNorm();
    check_size(name, "the distance of from and to", length);
    check_rounding(name, cylinder.rounding, std::min(cylinder.radius, 0.5 * length));
  }
  void operator()(const HalfSpaces&) const {}  // its constructor has refused
};

}  // namespace

SignedDistance signed_distance(const Shape& shape, const Vec3& p) {
  return std::visit([&](const auto& s) { return distance_to(s, p); }, shape);
}

void validate(const Shape& shape, const std::string& name) { std::visit(Validator{name}, shape); }

}  // namespace piecework::colliders
