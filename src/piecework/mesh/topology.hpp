#pragma once

// Edges, hinges, components and adjacency of triangle meshes.

#include <array>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::mesh {

/// One side of one triangle: the edge (v0, v1), v0 < v1, as seen from `triangle`.
struct HalfEdge {
  int v0;
  int v1;
  int triangle;
  bool forward;  ///< the triangle runs through it from v0 to v1
};

/// All triangle sides, sorted by (v0, v1, triangle): the sides of one edge are neighbours. Works on
/// any triangles with indices >= 0, non-manifold ones included (a side of a triangle that names a
/// vertex twice may have v0 == v1).
std::vector<HalfEdge> sorted_half_edges(const Triangles& triangles);

/// An undirected edge with the triangles on its two sides.
struct Edge {
  std::array<int, 2> vertices;   ///< v0 < v1
  std::array<int, 2> triangles;  ///< t0 < t1; t1 == -1 on the border
};

/// Two triangles that share an edge. Vertices: the shared edge (x0, x1), then the vertex opposite
/// it in triangle t0 (x2) and in t1 (x3), as in [Bergou et al. 2006].
struct Hinge {
  std::array<int, 4> vertices;
  std::array<int, 2> triangles;  ///< t0 < t1
};

/// All edges, sorted by (v0, v1).
/// \pre every edge has at most two triangles (validate() refuses other meshes).
std::vector<Edge> find_edges(const Triangles& triangles);

/// One hinge per interior edge, in the order of find_edges().
std::vector<Hinge> find_hinges(const Triangles& triangles, const std::vector<Edge>& edges);

/// Component number of each triangle; triangles that share an edge are in one component.
/// Components are numbered by their first triangle. Returns their number.
int edge_components(const Triangles& triangles, const std::vector<Edge>& edges,
                    std::vector<int>& component);

/// Vertices on border edges, ascending.
std::vector<int> border_vertices(const std::vector<Edge>& edges);

/// Fan number of every corner (3 per triangle, in triangle order): corners of one vertex whose
/// triangles hang together through edges at that vertex are in one fan. A vertex of a manifold has
/// one fan. Fans are numbered by their first corner. Works on non-manifold meshes.
/// \param sides  sorted_half_edges(triangles)
std::vector<int> corner_fans(const Triangles& triangles, const std::vector<HalfEdge>& sides);

/// Compressed rows: items of row r are item[begin[r]] ... item[begin[r + 1] - 1].
struct Adjacency {
  std::vector<int> begin;
  std::vector<int> item;
};

/// Triangles around each vertex, ascending.
Adjacency vertex_triangles(const Triangles& triangles, int num_vertices);

}  // namespace piecework::mesh
