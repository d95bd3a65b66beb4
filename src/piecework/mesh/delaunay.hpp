#pragma once

// Delaunay triangulations by edge flips (Lawson 1977). Internal to mesh/.

#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::mesh {

/// Flips the inner edges of a planar triangulation until no vertex lies inside the circumcircle of
/// a neighbouring triangle (by more than rounding: cocircular quads keep their diagonal).
/// \pre `triangles` are counter-clockwise, cover the convex hull of `points` or a part of it once,
///      and have area. They stay so; border edges stay.
void flip_to_delaunay(const std::vector<Vec2>& points, Triangles& triangles);

}  // namespace piecework::mesh
