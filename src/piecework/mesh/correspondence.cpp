#include <cstddef>
#include <vector>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/mesh/import.hpp>

namespace piecework::mesh {
namespace {

/// Welded vertices this far apart, relative to the size of the other shape, do not correspond.
constexpr double kApart = 1e-6;

/// Position of each file vertex, m.
Positions file_positions(const MeshDocument& document) {
  if (document.vertex_map.empty()) return document.mesh.positions;
  Positions positions(static_cast<Eigen::Index>(document.vertex_map.size()), 3);
  Eigen::Index next_dropped = 0;
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    const int vertex = document.vertex_map[static_cast<std::size_t>(v)];
    if (vertex >= 0) {
      positions.row(v) = document.mesh.positions.row(vertex);
    } else {
      positions.row(v) = document.layout.positions.row(next_dropped++);
    }
  }
  return positions;
}

bool have_same_faces(const MeshDocument& a, const MeshDocument& b) {
  if (a.layout.polygon_begin.empty() || b.layout.polygon_begin.empty())
    return a.mesh.triangles == b.mesh.triangles;
  return a.layout.polygon_begin == b.layout.polygon_begin &&
         a.layout.polygon_vertex == b.layout.polygon_vertex;
}

}  // namespace

Positions corresponding_positions(const MeshDocument& mesh, const MeshDocument& other,
                                  const std::string& other_name) {
  if (mesh.num_file_vertices() != other.num_file_vertices())
    throw InputError(fmt::format(
        "{}: {} vertices, the mesh it belongs to has {}; both files must list the same vertices",
        other_name, other.num_file_vertices(), mesh.num_file_vertices()));
  if (!have_same_faces(mesh, other))
    throw InputError(fmt::format(
        "{}: other faces than the mesh it belongs to; both files must list the same faces",
        other_name));
  Positions all = file_positions(other);
  if (mesh.vertex_map.empty()) return all;
  const double size = (all.colwise().maxCoeff() - all.colwise().minCoeff()).norm();
  Positions positions(mesh.mesh.num_vertices(), 3);
  std::vector<int> source(static_cast<std::size_t>(mesh.mesh.num_vertices()), -1);
  for (int v = 0; v < mesh.num_file_vertices(); ++v) {
    const int vertex = mesh.vertex_map[v];
    if (vertex < 0) continue;
    if (source[vertex] < 0) {
      source[vertex] = v;
      positions.row(vertex) = all.row(v);
    } else if ((all.row(v) - positions.row(vertex)).norm() > kApart * size) {
      throw InputError(
          fmt::format("{}: vertices {} and {} are apart, but one vertex in the mesh it "
                      "belongs to; set `weld: false`, or use texture coordinates as "
                      "rest shape",
                      other_name, source[vertex], v));
    }
  }
  return positions;
}

}  // namespace piecework::mesh
