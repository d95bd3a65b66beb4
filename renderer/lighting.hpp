#pragma once

// Light that reaches vertices and ground: a soft key light and the sky, both with shadows, computed
// by looking at the mesh from many directions (depth_map.hpp).

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <renderer/display_mesh.hpp>

namespace piecework::render {

struct LightOptions {
  Vec3f key_direction{0, 1, 0};  ///< towards the light, unit length, y > 0
  bool shadows = true;
  bool ambient_occlusion = true;
  std::optional<float> ground_height;  ///< display units; absent: no ground
};

/// Light at a vertex, 255 = unshadowed.
struct VertexLight {
  /// From the sky and from the ground on the front side, then on the back side, weighted with the
  /// cosine: sky + ground = 255 where nothing is in the way.
  std::array<std::uint8_t, 4> ambient{};
  std::uint8_t key = 255;  ///< of the key light, on the side that faces it
};

/// Light on a rectangle of the ground; unshadowed outside of it and along its rim.
struct GroundLight {
  static constexpr int kSize = 256;
  Eigen::Vector2f low{0, 0}, high{1, 1};  ///< x and z, display units
  std::vector<std::uint8_t> texels;       ///< kSize x kSize x (key, sky), rows along x
};

struct Lighting {
  std::vector<VertexLight> vertices;
  GroundLight ground;  ///< texels empty without a ground
};

/// Parallel; a function of its arguments only.
Lighting compute_lighting(const DisplayMesh& mesh, const LightOptions& options);

}  // namespace piecework::render
