#pragma once

// What every local step does with a triangle in the rank-deficient case. Private to `local`.

#include <piecework/model/constraints.hpp>
#include <piecework/model/projection.hpp>

namespace piecework::local {

/// F = X_t^T G, edges first.
inline Mat32 deformation_gradient(const model::StretchConstraint& c, const Positions& x) {
  Mat32 edges;
  edges.col(0) = (x.row(c.vertices[1]) - x.row(c.vertices[0])).transpose();
  edges.col(1) = (x.row(c.vertices[2]) - x.row(c.vertices[0])).transpose();
  return edges * c.rest_inverse;
}

/// Orientation for a degenerate triangle: at the start of the step, else in the start shape.
inline Mat32 reference_isometry(const model::StretchConstraint& c, const Positions& previous,
                                const Positions& start) {
  Mat32 reference = Mat32::Identity();
  if (!model::closest_isometry(deformation_gradient(c, previous), reference))
    model::closest_isometry(deformation_gradient(c, start), reference);
  return reference;
}

}  // namespace piecework::local
