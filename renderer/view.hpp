#pragma once

// The camera as vectors and matrices.

#include <renderer/renderer.hpp>

namespace piecework::render {

/// Orthonormal axes of a camera and its opening.
struct ViewBasis {
  Vec3 right, up, forward;
  double slope = 0;  ///< tangent of half the vertical field of view
};

/// \throws InputError if the camera looks nowhere (eye = target, not finite, fov out of range).
ViewBasis view_basis(const Camera& camera);

}  // namespace piecework::render
