#pragma once

// What a reader takes from a mesh file, before units, welding and checks. Internal to mesh/.

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::mesh {

/// Vertices one polygon may have; more are refused, since ear clipping is quadratic.
inline constexpr int kMaxPolygonCorners = 4096;

/// Polygons as the file lists them; every index is in range and every polygon has 3 or more
/// corners.
struct RawMesh {
  std::string file;             ///< opens every message
  std::vector<Vec3> positions;  ///< in file units
  FileLayout layout;            ///< polygons, texture coordinates, groups; the rest is set later
  /// Line of each vertex and polygon in a text file; empty for binary files.
  std::vector<int> vertex_line;
  std::vector<int> polygon_line;
  bool lists_vertices = true;  ///< false for STL, which repeats positions triangle by triangle
  std::vector<std::string> notes;

  [[nodiscard]] int num_polygons() const {
    return static_cast<int>(layout.polygon_begin.size()) - 1;
  }
  /// "line 7 (vertex 6)" or "vertex 6", counted from 0.
  [[nodiscard]] std::string vertex_name(int vertex) const;
  /// "line 60 (face 10)" or "face 10", counted from 0.
  [[nodiscard]] std::string polygon_name(int polygon) const;
};

/// Counts polygons against the limits while a file is read.
class SizeGuard {
 public:
  SizeGuard(std::string file, std::size_t max_triangles)
      : file_(std::move(file)), max_triangles_(max_triangles) {}
  /// \throws InputError if the polygon has more than kMaxPolygonCorners corners, or brings more
  ///         triangles than allowed. `kind` and `number` name it: "line", 60.
  void add_polygon(std::size_t corners, const char* kind, int number);
  /// \throws InputError if `count` vertices are more than that many triangles can use.
  void check_vertices(std::size_t count) const;

 private:
  std::string file_;
  std::size_t max_triangles_;
  std::size_t triangles_ = 0;
};

}  // namespace piecework::mesh
