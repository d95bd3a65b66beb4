#pragma once

// Polygons into triangles. Internal to mesh/.

#include <span>

#include <piecework/core/types.hpp>

namespace piecework::mesh {

/// Appends the n - 2 triangles of a polygon, as corner numbers 0..n-1, in the polygon's sense.
/// Quads are cut along the shorter diagonal (the first one if equal), where the other does not fold
/// the quad over; larger polygons by ear clipping in their mean plane, so concave and slightly
/// non-planar ones come out right. A polygon that crosses itself gets some n - 2 triangles.
/// \pre n >= 3
void triangulate_polygon(std::span<const Vec3> corners, Triangles& triangles);

}  // namespace piecework::mesh
