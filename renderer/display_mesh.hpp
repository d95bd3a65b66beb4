#pragma once

// The frame's meshes as they are drawn: checked, centred, scaled to unit size, with vertex normals,
// and with long edges split so that light stored at vertices is fine enough.

#include <cstdint>
#include <span>
#include <vector>

#include <renderer/renderer.hpp>

namespace piecework::render {

using Vec3f = Eigen::Vector3f;

/// Triangles around each vertex in compressed rows; triangle numbers ascend within a row.
struct Adjacency {
  std::vector<int> offset;    ///< |V| + 1
  std::vector<int> triangle;  ///< 3 |T|

  [[nodiscard]] std::span<const int> around(int vertex) const {
    return {triangle.data() + offset[vertex],
            static_cast<std::size_t>(offset[vertex + 1] - offset[vertex])};
  }
};

Adjacency build_adjacency(std::span<const Triangle> triangles, std::size_t num_vertices);

/// Display units: the box [low, high] has its centre at 0 and half diagonal 1, so that nothing
/// behind this point depends on the size of the scene. It is the box of the cloth and of what of
/// the bodies is nearer to it than its diagonal.
struct DisplayMesh {
  Vec3 centre{0, 0, 0};  ///< m
  double scale = 1;      ///< display units per metre
  Vec3f low{0, 0, 0}, high{0, 0, 0};
  std::vector<Vec3f> positions;     ///< of the cloth, then those of its split edges, then of bodies
  std::vector<Vec3f> normals;       ///< unit length
  std::vector<Triangle> triangles;  ///< of the cloth, then of bodies
  std::vector<int> source;          ///< per triangle of the cloth: its triangle in the frame
  std::size_t num_frame_vertices = 0;

  [[nodiscard]] bool empty() const { return triangles.empty(); }
  [[nodiscard]] std::span<const Triangle> cloth() const {
    return {triangles.data(), source.size()};
  }
  [[nodiscard]] Vec3 to_display(const Vec3& metres) const { return (metres - centre) * scale; }
};

/// \param longest_edge  display units; longer edges are split (0: none is)
/// \throws InputError if positions are missing or not finite, or a triangle names no vertex, of the
///         cloth or of a body.
DisplayMesh build_display_mesh(const Frame& frame, float longest_edge);

/// The same surface with every edge longer than `longest_edge` halved until none is left or the
/// mesh has `max_triangles`. Neighbours stay joined: an edge is split for both or not at all.
void split_long_edges(DisplayMesh& mesh, float longest_edge, std::size_t max_triangles);

}  // namespace piecework::render
