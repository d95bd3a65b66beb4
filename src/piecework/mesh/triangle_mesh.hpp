#pragma once

// Triangle meshes as plain data, with what a user's file said about them.

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::mesh {

/// Positions [m] and triangles; every index is in range (checked by validate()).
struct TriangleMesh {
  Positions positions;  ///< |V| x 3, m
  Triangles triangles;

  [[nodiscard]] int num_vertices() const { return static_cast<int>(positions.rows()); }
  [[nodiscard]] int num_triangles() const { return static_cast<int>(triangles.size()); }
};

/// The mesh as its file lists it, kept so that exports give the user the vertex order, quads,
/// texture coordinates and groups that came in. Empty polygons: the simulation mesh is the file.
struct FileLayout {
  struct Group {
    std::string name;
    int first_polygon = 0;
  };
  int num_vertices = 0;             ///< vertices in the file, unused ones included
  std::vector<int> polygon_begin;   ///< offsets into polygon_vertex, one more than polygons
  std::vector<int> polygon_vertex;  ///< file vertex per polygon corner
  std::vector<int> polygon_uv;      ///< index into uv per polygon corner, -1 none; may be empty
  std::vector<Vec2> uv;             ///< texture coordinates as the file lists them
  std::vector<Group> groups;        ///< in file order
  /// Positions [m] of the file vertices that are not in the simulation mesh (vertex_map is -1), one
  /// row each in file order; empty if there are none.
  Positions positions;
};

/// A mesh ready to simulate, whatever it came from.
struct MeshDocument {
  TriangleMesh mesh;  ///< welded, start shape, m, y up
  /// Flat rest shape: texture coordinate [m] of each triangle corner (3 per triangle, in triangle
  /// order); empty if the source has none.
  std::vector<Vec2> corner_uv;
  /// File vertex -> vertex of `mesh`; -1 for a file vertex that no face uses. Identity if empty.
  std::vector<int> vertex_map;
  FileLayout layout;
  /// Named vertex sets (vertices of `mesh`, ascending): "border", and per generator "corners",
  /// "left", "right", "top", "bottom"; per file group its name.
  std::map<std::string, std::vector<int>> vertex_sets;
  /// Human-readable notes: what was repaired, welded or dropped.
  std::vector<std::string> notes;

  [[nodiscard]] int num_file_vertices() const {
    return vertex_map.empty() ? mesh.num_vertices() : static_cast<int>(vertex_map.size());
  }
};

}  // namespace piecework::mesh
