#pragma once

// Everything the GL draws for one frame, prepared on the CPU.

#include <array>
#include <cstdint>
#include <vector>

#include <renderer/borders.hpp>
#include <renderer/display_mesh.hpp>
#include <renderer/lighting.hpp>
#include <renderer/view.hpp>

namespace piecework::render {

struct GpuVertex {
  std::array<float, 3> position;
  std::array<std::int16_t, 4> normal;  ///< signed, normalised
  std::array<std::uint8_t, 4> ambient;
  std::array<std::uint8_t, 4> key;  ///< first byte
};
static_assert(sizeof(GpuVertex) == 28);

struct GpuDot {
  std::array<float, 4> ball;   ///< centre and radius, display units
  std::array<float, 4> color;  ///< square root of linear light
};

/// The camera in display units.
struct DisplayView {
  ViewBasis basis;
  Vec3 eye{0, 0, 1};
  double near_depth = 0.1, far_depth = 10;
  double pixel = 0.001;  ///< size of a picture pixel at depth 1
};

struct DrawData {
  DisplayMesh mesh;
  DisplayView view;
  Vec3f key_direction{0, 1, 0}, fill_direction{0, 1, 0};
  GroundLight ground;       ///< texels empty: no ground is drawn
  float ground_height = 0;  ///< display units
  std::vector<GpuVertex> vertices;
  /// Triangles of the cloth without border segments, with border segments, those of bodies.
  std::vector<std::uint32_t> indices;
  std::size_t num_plain_triangles = 0, num_border_triangles = 0, num_body_triangles = 0;
  std::vector<std::array<std::uint8_t, 4>> colors;  ///< per triangle of the cloth as drawn
  std::vector<std::array<float, 4>> corners;        ///< three per triangle, for mesh lines
  Borders borders;
  std::vector<GpuDot> dots;
  float border_pixels = 1, line_pixels = 0.5F;  ///< half widths
  std::size_t num_duplicates = 0, num_corners = 0;
};

/// \throws InputError if spans do not fit the mesh or the mode, or style or camera are invalid.
DrawData prepare(const Frame& frame, const Camera& camera, const Style& style, int width,
                 int height);

/// Colours of dots, also for the legend.
Rgb dot_color(DofClass kind);

}  // namespace piecework::render
