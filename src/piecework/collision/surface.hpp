#pragma once

// The surfaces among which collisions are looked for.

#include <array>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::collision {

/// In every list cloth first, then obstacles: bodies whose motion is prescribed. Obstacles never
/// collide with each other. Elements that share a vertex never collide.
struct Surface {
  int num_vertices = 0;                   ///< of cloth and obstacles
  int num_cloth_vertices = 0;             ///< vertices below this are cloth
  Triangles triangles;                    ///< of cloth: all vertices cloth; of obstacles: none
  std::vector<std::array<int, 2>> edges;  ///< each once, v0 < v1
  bool self = true;                       ///< cloth collides with cloth

  [[nodiscard]] bool is_cloth(int vertex) const { return vertex < num_cloth_vertices; }
};

/// \param obstacle_triangles  vertices from 0; they are numbered after the cloth's
Surface make_surface(const Triangles& cloth, int num_cloth_vertices,
                     const Triangles& obstacle_triangles, int num_obstacle_vertices, bool self);

}  // namespace piecework::collision
