#pragma once

// Local projections: the closest point of a constraint's target set.

#include <piecework/core/types.hpp>

namespace piecework::model {

/// The isometry closest to a 3 x 2 deformation gradient, R = F (F^T F)^-1/2, in closed form.
/// Returns false, R untouched, if F is (nearly) rank deficient: sigma_2 < 1e-7 sigma_1.
bool closest_isometry(const Mat32& F, Mat32& R);

/// The same for any F, finite or not yet: a rank-one F is completed with the normal of `reference`
/// (an isometry; the triangle's orientation at the start of the step), F = 0 gives `reference`.
/// The result is an isometry whenever F is finite, and never NaN then.
Mat32 closest_isometry_degenerate(const Mat32& F, const Mat32& reference);

}  // namespace piecework::model
