#include <piecework/mesh/import.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/mesh/assimp_reader.hpp>
#include <piecework/mesh/checks.hpp>
#include <piecework/mesh/input_file.hpp>
#include <piecework/mesh/obj_reader.hpp>
#include <piecework/mesh/repair.hpp>
#include <piecework/mesh/topology.hpp>
#include <piecework/mesh/work_mesh.hpp>

namespace piecework::mesh {
namespace {

namespace fs = std::filesystem;

RawMesh read_raw(const fs::path& path, std::size_t max_triangles) {
  const std::string extension = lower_extension(path);
  const bool is_obj = extension == ".obj";
  if (!is_obj && extension != ".ply" && extension != ".stl" && extension != ".gltf" &&
      extension != ".glb")
    throw InputError(fmt::format(
        "{}: unknown kind of mesh file '{}'; convert it to .obj, .ply, .stl, .gltf or .glb",
        path.string(), extension));
  check_file(path);
  return is_obj ? read_obj(path.string(), read_file(path), max_triangles)
                : read_with_assimp(path, extension, max_triangles);
}

void check_options(const fs::path& path, const ImportOptions& options) {
  if (!std::isfinite(options.unit_in_metres) || !(options.unit_in_metres > 0))
    throw InputError(fmt::format(
        "{}: units: {} metres per unit; give a positive number, 0.01 for a file in centimetres",
        path.string(), options.unit_in_metres));
}

Vec3 turn_up(const Vec3& p, UpAxis axis) {
  switch (axis) {
    case UpAxis::X:
      return {-p.y(), p.x(), p.z()};
    case UpAxis::Z:
      return {p.x(), p.z(), -p.y()};
    case UpAxis::Y:
      break;
  }
  return p;
}

ItemNames names_of(const RawMesh& raw, const WorkMesh& work) {
  return {raw.file,
          [&](int v) {
            const auto file_vertex = std::find(work.vertex_map.begin(), work.vertex_map.end(), v);
            return raw.vertex_name(static_cast<int>(file_vertex - work.vertex_map.begin()));
          },
          [&](int t) { return raw.polygon_name(work.triangle_polygon[t]); }};
}

void note_lost_precision(const TriangleMesh& mesh, std::vector<std::string>& notes) {
  constexpr double kFewSteps = 1e6;
  double fewest = kFewSteps;
  for (int t = 0; t < mesh.num_triangles(); ++t) fewest = std::min(fewest, edge_steps(mesh, t));
  if (fewest < kFewSteps)
    notes.push_back(fmt::format(
        "far from the origin: some edges are only {:.2g} rounding steps of their coordinates long; "
        "move the mesh to the origin for more precision",
        fewest));
}

/// Positions [m] of the file vertices that the mesh dropped, in file order.
Positions dropped_positions(const RawMesh& raw, const std::vector<int>& vertex_map) {
  const auto count = std::count(vertex_map.begin(), vertex_map.end(), -1);
  Positions positions(count, 3);
  Eigen::Index row = 0;
  for (std::size_t v = 0; v < vertex_map.size(); ++v) {
    if (vertex_map[v] < 0) positions.row(row++) = raw.positions[v].transpose();
  }
  return positions;
}

/// "border", and a set for each named group.
void add_vertex_sets(const std::vector<FileLayout::Group>& groups,
                     const std::vector<int>& triangle_polygon, MeshDocument& document) {
  std::size_t group = 0;
  for (int t = 0; t < document.mesh.num_triangles() && !groups.empty(); ++t) {
    const int polygon = triangle_polygon[t];
    while (group + 1 < groups.size() && groups[group + 1].first_polygon <= polygon) ++group;
    if (groups[group].name.empty() || groups[group].first_polygon > polygon) continue;
    std::vector<int>& set = document.vertex_sets[groups[group].name];
    const Triangle& triangle = document.mesh.triangles[t];
    set.insert(set.end(), triangle.begin(), triangle.end());
  }
  for (auto& [name, set] : document.vertex_sets) {
    std::sort(set.begin(), set.end());
    set.erase(std::unique(set.begin(), set.end()), set.end());
  }
  if (document.vertex_sets.contains("border"))
    document.notes.push_back(
        "the vertex set 'border' is the border of the mesh, not the group of that name");
  document.vertex_sets["border"] = border_vertices(find_edges(document.mesh.triangles));
}

bool is_identity(const std::vector<int>& map) {
  for (std::size_t i = 0; i < map.size(); ++i) {
    if (map[i] != static_cast<int>(i)) return false;
  }
  return true;
}

MeshDocument finish(RawMesh&& raw, WorkMesh&& work, std::vector<std::string>&& notes) {
  MeshDocument document;
  document.mesh = std::move(work.mesh);
  document.corner_uv = std::move(work.corner_uv);
  document.notes = std::move(notes);
  add_vertex_sets(raw.layout.groups, work.triangle_polygon, document);
  if (!raw.lists_vertices) return document;
  raw.layout.num_vertices = static_cast<int>(raw.positions.size());
  raw.layout.positions = dropped_positions(raw, work.vertex_map);
  document.layout = std::move(raw.layout);
  if (!is_identity(work.vertex_map)) document.vertex_map = std::move(work.vertex_map);
  return document;
}

}  // namespace

MeshDocument import_mesh(const fs::path& path, const ImportOptions& options) {
  check_options(path, options);
  RawMesh raw = read_raw(path, std::min(options.max_triangles, kMaxTriangles));
  for (Vec3& p : raw.positions) p = options.unit_in_metres * turn_up(p, options.up_axis);
  std::vector<std::string> notes = std::move(raw.notes);
  if (!raw.layout.polygon_uv.empty() &&
      std::count(raw.layout.polygon_uv.begin(), raw.layout.polygon_uv.end(), -1) > 0)
    notes.push_back("some corners have no texture coordinates, so none are used as rest shape");

  WorkMesh work = triangulate(raw);
  check_coordinates(work.mesh.positions, names_of(raw, work));
  if (const int merged = options.weld ? weld(raw, work) : 0; merged > 0)
    notes.push_back(fmt::format("welded {} vertices to {}", work.mesh.num_vertices() + merged,
                                work.mesh.num_vertices()));
  if (options.repair) repair(raw, work, notes);
  check_surface(work.mesh, names_of(raw, work));
  note_lost_precision(work.mesh, notes);
  return finish(std::move(raw), std::move(work), std::move(notes));
}

}  // namespace piecework::mesh
