#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <piecework/colliders/shapes.hpp>
#include <piecework/core/error.hpp>

namespace piecework::colliders {
namespace {

/// Faces whose normals enclose a smaller angle (rad) count as parallel: their edge is too far away
/// or too uncertain to be known. Chosen.
constexpr double kParallel = 1e-9;

/// A point counts as below a plane if it is at most this far above it, in units of the size of its
/// coordinates and of 1 m: rounding of products of coordinates. Chosen.
constexpr double kRounding = 1e-12;

double slack(const Vec3& p) { return kRounding * (1 + p.lpNorm<Eigen::Infinity>()); }

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Cuts a convex polygon along a plane and keeps what is below it [Sutherland and Hodgman 1974].
std::vector<Vec3> cut(const std::vector<Vec3>& polygon, const Vec3& normal, double offset) {
  std::vector<Vec3> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3& a = polygon[i];
    const Vec3& b = polygon[(i + 1) % polygon.size()];
    const double above_a = normal.dot(a) - offset;
    const double above_b = normal.dot(b) - offset;
    if (above_a <= 0) kept.push_back(a);
    if ((above_a <= 0) != (above_b <= 0))
      kept.push_back(a + above_a / (above_a - above_b) * (b - a));
  }
  return kept;
}

}  // namespace

HalfSpaces::HalfSpaces(const std::vector<Plane>& planes, double rounding) : rounding_(rounding) {
  if (planes.empty() || planes.size() > kMaxPlanes)
    throw InputError(
        fmt::format("half_spaces: {} planes; give 1 to {}", planes.size(), kMaxPlanes));
  if (!std::isfinite(rounding) || rounding < 0)
    throw InputError(
        fmt::format("half_spaces: rounding is {} m; give a length from 0 up", rounding));
  for (const Plane& plane : planes) {
    validate(plane, fmt::format("half_spaces: plane {}", &plane - planes.data()));
    const Vec3 normal = plane.normal.stableNormalized();
    add_face({normal, normal.dot(plane.point) - rounding});
  }
  find_edges();
  Vec3 foot;
  const Vec3 origin = Vec3::Zero();
  if (!contains(origin) && !nearest(origin, foot))
    throw InputError(fmt::format(
        "half_spaces: no point lies below all {} planes{}; turn a normal or move a plane",
        planes.size(), rounding > 0 ? " when they are moved inward by the rounding" : ""));
}

void HalfSpaces::add_face(const Face& face) {
  for (Face& other : faces_) {
    if ((other.normal - face.normal).norm() > kParallel) continue;
    other.offset = std::min(other.offset, face.offset);
    return;
  }
  faces_.push_back(face);
}

void HalfSpaces::find_edges() {
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    for (std::size_t j = i + 1; j < faces_.size(); ++j) {
      const Vec3& n = faces_[i].normal;
      const Vec3& m = faces_[j].normal;
      const Vec3 cross = n.cross(m);
      const double sine_sq = cross.squaredNorm();
      if (sine_sq <= kParallel * kParallel) continue;
      Edge edge{(faces_[i].offset * m.cross(cross) + faces_[j].offset * cross.cross(n)) / sine_sq,
                cross / std::sqrt(sine_sq), -kInfinity, kInfinity};
      for (std::size_t k = 0; k < faces_.size(); ++k) {
        if (k == i || k == j) continue;
        const double slope = faces_[k].normal.dot(edge.direction);
        const double room = faces_[k].offset - faces_[k].normal.dot(edge.origin);
        if (slope > kParallel) edge.end = std::min(edge.end, room / slope);
        if (slope < -kParallel) edge.begin = std::max(edge.begin, room / slope);
        if (std::abs(slope) <= kParallel && room < -slack(edge.origin))
          edge.begin = kInfinity, edge.end = -kInfinity;
      }
      if (edge.begin <= edge.end + slack(edge.origin)) edges_.push_back(edge);
    }
  }
}

bool HalfSpaces::contains(const Vec3& p) const {
  return std::all_of(faces_.begin(), faces_.end(), [&](const Face& face) {
    return face.normal.dot(p) - face.offset <= slack(p);
  });
}

bool HalfSpaces::nearest(const Vec3& p, Vec3& foot) const {
  double best = kInfinity;
  const auto consider = [&](const Vec3& candidate) {
    const double distance_sq = (p - candidate).squaredNorm();
    if (!(distance_sq < best)) return;
    best = distance_sq;
    foot = candidate;
  };
  for (const Face& face : faces_) {
    const double above = face.normal.dot(p) - face.offset;
    const Vec3 candidate = p - above * face.normal;
    if (above > 0 && contains(candidate)) consider(candidate);
  }
  for (const Edge& edge : edges_) {
    const double along = edge.direction.dot(p - edge.origin);
    consider(edge.origin + std::max(edge.begin, std::min(edge.end, along)) * edge.direction);
  }
  return best < kInfinity;
}

SignedDistance HalfSpaces::signed_distance(const Vec3& p) const {
  SignedDistance result{-kInfinity, Vec3::UnitY()};
  for (const Face& face : faces_) {
    const double above = face.normal.dot(p) - face.offset;
    if (above > result.distance) result = {above, face.normal};
  }
  // Outside, the largest of the distances from the planes is a lower bound only.
  Vec3 foot;
  if (result.distance > 0 && nearest(p, foot)) {
    const double distance = (p - foot).stableNorm();
    if (distance > slack(p)) result = {distance, (p - foot) / distance};
  }
  result.distance -= rounding_;
  return result;
}

std::vector<std::vector<Vec3>> HalfSpaces::faces(double extent) const {
  Vec3 sum = Vec3::Zero();
  int count = 0;
  for (const Edge& edge : edges_)
    for (const double end : {edge.begin, edge.end})
      if (std::isfinite(end)) sum += edge.origin + end * edge.direction, ++count;
  const Vec3 middle = count > 0 ? Vec3(sum / count) : sum;
  std::vector<std::vector<Vec3>> polygons;
  for (const Face& face : faces_) {
    const Vec3 u = face.normal.unitOrthogonal();
    const Vec3 v = face.normal.cross(u);
    const double above = face.normal.dot(middle) - face.offset - rounding_;
    const Vec3 foot = middle - above * face.normal;
    std::vector<Vec3> polygon{foot + extent * (-u - v), foot + extent * (u - v),
                              foot + extent * (u + v), foot + extent * (v - u)};
    for (const Face& other : faces_)
      if (&other != &face) polygon = cut(polygon, other.normal, other.offset + rounding_);
    if (polygon.size() >= 3) polygons.push_back(std::move(polygon));
  }
  return polygons;
}

}  // namespace piecework::colliders
