#pragma once

// Local projections: the closest point of a constraint's target set.

#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::model {

/// The isometry closest to a 3 x 2 deformation gradient, R = F (F^T F)^-1/2, in closed form.
/// Returns false, R untouched, if F is (nearly) rank deficient: sigma_2 < 1e-7 sigma_1.
bool closest_isometry(const Mat32& F, Mat32& R);

/// The same for any F, finite or not yet: a rank-one F is completed with the normal of `reference`
/// (an isometry; the triangle's orientation at the start of the step), F = 0 gives `reference`.
/// The result is an isometry whenever F is finite, and never NaN then.
Mat32 closest_isometry_degenerate(const Mat32& F, const Mat32& reference);

/// F = [x1 - x0, x2 - x0] Dm^-1 of a triangle, 3 x 2, dimensionless. \param x  |V| x 3, m
Mat32 deformation_gradient(const StretchConstraint& c, const Positions& x);

/// The closest isometry to F = deformation_gradient(c, x), whatever F is: where it is rank
/// deficient, with the triangle's orientation in `previous`, else in `start` (|V| x 3, m).
/// Returns true if that was needed.
bool project_stretch(const StretchConstraint& c, const Mat32& F, const Positions& previous,
                     const Positions& start, Mat32& R);

}  // namespace piecework::model
