#include <piecework/mesh/raw_mesh.hpp>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::mesh {
namespace {

std::string item_name(const char* kind, int item, const std::vector<int>& lines) {
  if (lines.empty()) return fmt::format("{} {}", kind, item);
  return fmt::format("line {} ({} {})", lines[item], kind, item);
}

}  // namespace

std::string RawMesh::vertex_name(int vertex) const {
  return item_name("vertex", vertex, vertex_line);
}

std::string RawMesh::polygon_name(int polygon) const {
  return item_name("face", polygon, polygon_line);
}

void SizeGuard::add_polygon(std::size_t corners, const char* kind, int number) {
  if (corners > kMaxPolygonCorners)
    throw InputError(fmt::format("{}: {} {}: {} corners, at most {} are supported; split the face",
                                 file_, kind, number, corners, kMaxPolygonCorners));
  triangles_ += corners - 2;
  if (triangles_ > max_triangles_)
    throw InputError(fmt::format(
        "{}: {} {}: more than {} triangles; simplify the mesh or split it over several files",
        file_, kind, number, max_triangles_));
}

void SizeGuard::check_vertices(std::size_t count) const {
  if (count > 3 * max_triangles_ + 3)
    throw InputError(
        fmt::format("{}: more than {} vertices, which no mesh of up to {} triangles uses; remove "
                    "unused vertices or simplify the mesh",
                    file_, 3 * max_triangles_ + 3, max_triangles_));
}

}  // namespace piecework::mesh
