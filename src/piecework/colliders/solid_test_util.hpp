#pragma once

// What the tests of colliders/ share: distance and inside of a triangle mesh by brute force.

#include <cmath>
#include <limits>
#include <numbers>

#include <piecework/collision/distance.hpp>
#include <piecework/core/random.hpp>
#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::colliders {

inline Vec3 random_point(Random& random, double extent) {
  const double x = random.uniform(-extent, extent), y = random.uniform(-extent, extent);
  return {x, y, random.uniform(-extent, extent)};
}

inline double distance_to_triangles(const mesh::TriangleMesh& mesh, const Vec3& p) {
  double best_sq = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles) {
    const collision::PairPoints x{p, mesh.positions.row(t[0]), mesh.positions.row(t[1]),
                                  mesh.positions.row(t[2])};
    best_sq = std::min(best_sq, collision::closest_vertex_triangle(x).distance_sq);
  }
  return std::sqrt(best_sq);
}

/// 1 inside of a closed surface that faces outward, 0 outside (Van Oosterom, Strackee 1983).
inline double winding_number(const mesh::TriangleMesh& mesh, const Vec3& p) {
  double solid_angle = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.positions.row(t[0]).transpose() - p;
    const Vec3 b = mesh.positions.row(t[1]).transpose() - p;
    const Vec3 c = mesh.positions.row(t[2]).transpose() - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    solid_angle += 2 * std::atan2(a.dot(b.cross(c)),
                                  la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return solid_angle / (4 * std::numbers::pi);
}

}  // namespace piecework::colliders
