#include <piecework/collision/surface.hpp>

#include <piecework/mesh/topology.hpp>

namespace piecework::collision {
namespace {

/// Works on non-manifold triangles as well: obstacles may be anything.
void add_edges(const Triangles& triangles, std::vector<std::array<int, 2>>& edges) {
  const std::vector<mesh::HalfEdge> sides = mesh::sorted_half_edges(triangles);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const bool repeated = i > 0 && sides[i].v0 == sides[i - 1].v0 && sides[i].v1 == sides[i - 1].v1;
    if (!repeated && sides[i].v0 != sides[i].v1) edges.push_back({sides[i].v0, sides[i].v1});
  }
}

}  // namespace

Surface make_surface(const Triangles& cloth, int num_cloth_vertices,
                     const Triangles& obstacle_triangles, int num_obstacle_vertices, bool self) {
  Surface surface;
  surface.num_cloth_vertices = num_cloth_vertices;
  surface.num_vertices = num_cloth_vertices + num_obstacle_vertices;
  surface.self = self;
  surface.triangles = cloth;
  add_edges(cloth, surface.edges);
  Triangles obstacle = obstacle_triangles;
  for (Triangle& triangle : obstacle)
    for (int& v : triangle) v += num_cloth_vertices;
  add_edges(obstacle, surface.edges);
  surface.triangles.insert(surface.triangles.end(), obstacle.begin(), obstacle.end());
  return surface;
}

}  // namespace piecework::collision
