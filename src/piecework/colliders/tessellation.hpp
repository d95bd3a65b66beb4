#pragma once

// Triangles of analytic shapes.

#include <string>

#include <piecework/colliders/shapes.hpp>
#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::colliders {

/// Chords of a quarter of a circle. Chosen: round at the size of a picture.
inline constexpr int kRoundInPictures = 16;

/// For pictures: all vertices on the surface (half-spaces: of the solid without rounding); closed
/// if the shape is bounded, but for half-spaces, whose faces have corners of their own. What is
/// unbounded is cut off at about `extent` (m).
mesh::TriangleMesh tessellate(const Shape& shape, double extent);

/// For contact: closed, all vertices on the surface, so curved parts lie inside of it by up to
/// 0.4 % of their radius with 8 chords, 0.1 % with 16.
/// \param quarter  chords of a quarter of a circle (rounded boxes: half as many), at least 1
/// \param name  of the body, for messages
/// \pre no plane; no rounded half-spaces
/// \throws InputError if half-spaces are unbounded
mesh::TriangleMesh closed_surface(const Shape& shape, int quarter, const std::string& name);

}  // namespace piecework::colliders
