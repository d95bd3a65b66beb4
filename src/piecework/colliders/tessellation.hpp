#pragma once

// Triangles of analytic shapes. Internal to colliders/.

#include <piecework/colliders/shapes.hpp>
#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::colliders {

/// For pictures: all vertices on the surface (half-spaces: of the solid without rounding); closed
/// if the shape is bounded. What is unbounded is cut off at about `extent` (m).
mesh::TriangleMesh tessellate(const Shape& shape, double extent);

}  // namespace piecework::colliders
