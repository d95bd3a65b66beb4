#pragma once

// Lines between domains, painted on the surface by the fragment shader: for each triangle near a
// border, the list of border edges that can colour a part of it.

#include <array>
#include <span>
#include <vector>

#include <renderer/display_mesh.hpp>

namespace piecework::render {

struct Borders {
  struct Segment {
    std::array<float, 3> start;
    float unused_start;
    std::array<float, 3> end;
    float unused_end;
  };
  std::vector<int> triangles;              ///< those with at least one segment, ascending
  std::vector<std::array<int, 2>> ranges;  ///< per entry of `triangles`: first segment, count
  std::vector<Segment> segments;           ///< display units
  std::vector<std::array<int, 2>> edges;   ///< all border edges, as vertices
};

/// \param triangle_domain  per triangle of the *frame*
/// \param reach            display units: half the line's width where it is widest
Borders find_borders(const DisplayMesh& mesh, std::span<const int> triangle_domain, float reach);

}  // namespace piecework::render
