#pragma once

// A mesh on its way from file polygons to simulation triangles. Internal to mesh/.

#include <string>
#include <vector>

#include <piecework/mesh/raw_mesh.hpp>
#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::mesh {

struct WorkMesh {
  TriangleMesh mesh;
  std::vector<Vec2> corner_uv;        ///< 3 per triangle, or empty
  std::vector<int> triangle_polygon;  ///< file polygon of each triangle
  std::vector<int> vertex_map;        ///< file vertex -> vertex of `mesh`, -1 dropped
};

/// Cuts the polygons into triangles; vertices are those of the file.
WorkMesh triangulate(const RawMesh& raw);

/// Merges vertices of one group at exactly the same position (0.0 and -0.0 are the same): those on
/// the border of the surface, where seams split it, and the ends of edges of length 0. Inner
/// vertices stay apart, and so do surfaces that would touch in nothing but a point: merging there
/// would only break a manifold. Vertices keep the order of their first file vertex.
/// Returns the number of vertices that went.
int weld(const RawMesh& raw, WorkMesh& work);

}  // namespace piecework::mesh
