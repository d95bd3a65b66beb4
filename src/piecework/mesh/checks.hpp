#pragma once

// What can be wrong with a triangle mesh, one function per kind of trouble. Internal to mesh/;
// users call validate() and import_mesh().

#include <functional>
#include <string>
#include <vector>

#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::mesh {

/// Triangles flatter than this (height over longest edge) count as zero-area. Chosen: 1000 times
/// flatter than the thinnest slivers that must pass (1e-7), 100 000 times above rounding.
inline constexpr double kMinFlatness = 1e-10;

/// Coordinates beyond this are a unit mistake (further than Saturn) and are refused. Chosen.
inline constexpr double kMaxCoordinate = 1e12;

/// A triangle whose longest edge is shorter than this many rounding steps of its coordinates has
/// lost its shape to rounding and is refused. Chosen: 3 digits of each edge are left.
inline constexpr double kMinEdgeSteps = 1e3;

/// Rounding steps of the largest coordinate in the longest edge of the triangle.
double edge_steps(const TriangleMesh& mesh, int triangle);

/// Triangles that name a vertex twice or are flatter than kMinFlatness.
std::vector<int> zero_area_triangles(const TriangleMesh& mesh);

/// Triangles on the same three vertices as an earlier one, in any order.
std::vector<int> duplicate_triangles(const Triangles& triangles);

/// An edge and the triangles on it, ascending.
struct EdgeUse {
  int v0;
  int v1;
  std::vector<int> triangles;
};

/// Edges with more than two triangles.
std::vector<EdgeUse> crowded_edges(const Triangles& triangles);

/// Edges whose two triangles run through them in the same direction.
std::vector<EdgeUse> clashing_edges(const Triangles& triangles);

/// Vertices whose triangles form more than one fan.
std::vector<int> pinched_vertices(const Triangles& triangles, int num_vertices);

/// Vertices that no triangle uses.
std::vector<int> isolated_vertices(const Triangles& triangles, int num_vertices);

/// How messages name items of the mesh.
struct ItemNames {
  std::string mesh;  ///< opens every message
  std::function<std::string(int)> vertex;
  std::function<std::string(int)> triangle;
};

/// \throws InputError for the first NaN, infinite or huge coordinate.
void check_coordinates(const Positions& positions, const ItemNames& names);

/// Everything but index range and coordinates. \throws InputError as import_mesh().
void check_surface(const TriangleMesh& mesh, const ItemNames& names);

}  // namespace piecework::mesh
