#pragma once

// What stays as it is while cloth is untangled. Private to `untangle`.

#include <array>
#include <optional>
#include <vector>

#include <piecework/collision/intersections.hpp>
#include <piecework/collision/surface.hpp>
#include <piecework/contact/contact.hpp>
#include <piecework/mesh/topology.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/untangle/untangle.hpp>

#include "nearest_surface.hpp"

namespace piecework::untangle {

/// A mesh with an inside.
struct ClosedMesh {
  Triangles triangles;
  Positions x;         ///< m
  int first_vertex;    ///< of the surface
  double distance;     ///< at which contact begins, m
  double orientation;  ///< 1 if triangles face outward, -1 if inward
  NearestSurface way_out;
};

struct Setting {
  Setting(const model::ClothModel& model, const contact::Colliders& colliders,
          const std::vector<char>& held, const UntangleOptions& options);

  const model::ClothModel& model;
  std::vector<char> held;  ///< per vertex of cloth
  double distance;         ///< of cloth, m
  contact::Obstacles obstacles;
  Positions obstacle_x;  ///< m
  collision::Surface surface;
  mesh::Adjacency triangles_at;  ///< of the surface, around each vertex
  std::vector<int> piece;        ///< per vertex of cloth: pieces hang together by edges and seams
  std::vector<ClosedMesh> closed;
  std::span<const colliders::AnalyticCollider> bodies;
  std::vector<Eigen::Isometry3d> poses;  ///< of the bodies

  /// Moves when cloth does.
  [[nodiscard]] bool is_free(int v) const {
    return surface.is_cloth(v) && !held[static_cast<std::size_t>(v)];
  }
  /// Contact distance of an element with this vertex, m.
  [[nodiscard]] double distance_of(int v) const;
  [[nodiscard]] double distance_of_body(int body) const;
  /// The number in `closed` of the mesh that an obstacle's vertex belongs to, -1: it is open.
  [[nodiscard]] int closed_mesh(int v) const;
  /// An end of the edge is sewn to a corner of the triangle.
  [[nodiscard]] bool are_sewn(const std::array<int, 2>& edge, const Triangle& triangle) const;
  /// Two vertices of cloth are joined by an edge.
  [[nodiscard]] bool are_neighbours(int v, int w) const;
};

}  // namespace piecework::untangle
