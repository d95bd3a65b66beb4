#include "scenery.hpp"

#include <algorithm>
#include <variant>

namespace piecework::cli {
namespace {

using colliders::AnalyticCollider;

/// What reaches farther than this counts as unbounded, m.
constexpr double kUnbounded = 1e5;

bool is_bounded(const AnalyticCollider& collider) {
  Bounds bounds;
  bounds.include(collider.tessellate(0, 10 * kUnbounded).positions);
  return bounds.size() < kUnbounded;
}

/// The height of a plane whose normal points up.
std::optional<double> level_height(const AnalyticCollider& collider, double time) {
  const auto* plane = std::get_if<colliders::Plane>(&collider.shape());
  if (plane == nullptr) return std::nullopt;
  const Eigen::Isometry3d pose = collider.pose(time);
  constexpr double kLevel = 1 - 1e-9;  // cosine: rises by less than 5e-5 of its length
  if ((pose.linear() * plane->normal.stableNormalized()).y() < kLevel) return std::nullopt;
  return (pose * plane->point).y();
}

}  // namespace

std::vector<mesh::TriangleMesh> bodies_at(const runner::World& world, double time, const Vec3& eye,
                                          const Bounds& cloth) {
  // Unbounded faces are cut off around the origin.
  const double extent = (cloth.low / 2 + cloth.high / 2).norm() + 2 * cloth.size();
  std::vector<mesh::TriangleMesh> bodies;
  for (const AnalyticCollider& collider : world.analytic_colliders)
    if (!level_height(collider, time) && collider.signed_distance(eye, time).distance > 0)
      bodies.push_back(collider.tessellate(time, extent));
  for (const colliders::MeshCollider& collider : world.mesh_colliders) {
    bodies.push_back({{}, collider.triangles()});
    collider.positions_at(time, bodies.back().positions);
  }
  return bodies;
}

Bounds bounds_of_bodies(const runner::World& world, double time) {
  Bounds bounds;
  for (const AnalyticCollider& collider : world.analytic_colliders)
    if (is_bounded(collider)) bounds.include(collider.tessellate(time, kUnbounded).positions);
  Positions x;
  for (const colliders::MeshCollider& collider : world.mesh_colliders) {
    collider.positions_at(time, x);
    bounds.include(x);
  }
  return bounds;
}

std::optional<double> level_ground(const runner::World& world, double time) {
  std::optional<double> ground;
  for (const AnalyticCollider& collider : world.analytic_colliders)
    if (const auto height = level_height(collider, time))
      ground = std::max(ground.value_or(*height), *height);
  return ground;
}

Bounds framed(const Bounds& cloth, const Bounds& bodies) {
  if (bodies.empty()) return cloth;
  Bounds all = cloth;
  all.include(bodies);
  constexpr double kWhole = 2.5;   // sizes of the cloth: a garment's wearer fits in
  constexpr double kAround = 0.4;  // sizes of the cloth: what is seen of larger bodies
  if (all.size() <= kWhole * cloth.size()) return all;
  const double around = kAround * cloth.size();
  all.low = all.low.cwiseMax((cloth.low.array() - around).matrix());
  all.high = all.high.cwiseMin((cloth.high.array() + around).matrix());
  return all;
}

}  // namespace piecework::cli
