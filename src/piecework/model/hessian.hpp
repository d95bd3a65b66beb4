#pragma once

// Second derivatives of the constraints' energies, without a singular value decomposition.
//
// Projective dynamics' matrix is the second derivative at frozen projections y, an upper bound.
// What it lacks is that y follows x, and that only ever softens:
//     triangle   H_ab = w (G_a . G_b) I   - [c_T w t_a t_b^T + w (G_a^T B G_b) n n^T]
//     hinge      H_ab = w c_a c_b I       - c_a c_b w (L / |v|) (I - v v^T / |v|^2),   v = c^T x
// with G_a the gradient of corner a's shape function (F = sum_a x_a G_a^T), S = (F^T F)^1/2,
// R = F S^-1, t_a = (R_1 G_a2 - R_2 G_a1) / sqrt 2, n = R_1 x R_2, c_T = 2 / tr S and B = S^-1.
// So the softening is all that has to be computed.

#include <array>

#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::model {

enum class HessianForm {
  Unprojected,  ///< the second derivative; indefinite where cloth is compressed
  /// The nearest positive semidefinite one, per element: c_T <= 1, eigenvalues of B <= 1,
  /// L / |v| <= 1 [Teran et al. 2005, in closed form]. Equal to the other where that is
  /// semidefinite.
  Projected,
};

/// G_a of a triangle's three corners, 1/m.
std::array<Vec2, 3> shape_gradients(const StretchConstraint& c);

/// What is subtracted from w (G_a . G_b) I of a triangle.
struct StretchSoftening {
  Mat3 twist;   ///< column a: sqrt(c_T w) t_a
  Vec3 normal;  ///< n
  Mat3 bend;    ///< (a, b): w G_a^T B G_b, N/m

  /// Between the corners a and b, N/m.
  [[nodiscard]] Mat3 block(int a, int b) const {
    return twist.col(a) * twist.col(b).transpose() + bend(a, b) * (normal * normal.transpose());
  }
};

/// \param F  deformation_gradient() \param R  its closest isometry, from project_stretch()
/// A rank-deficient F has no second derivative: it always takes the projected form, which is
/// finite.
StretchSoftening stretch_softening(const StretchConstraint& c, const Mat32& F, const Mat32& R,
                                   HessianForm form);

/// What is subtracted from w I of a hinge, before c_a c_b; N/m. Zero for a flat rest shape, and for
/// a curved hinge that is momentarily flat, which has no direction (local::JacobiStep).
/// \param x  |V| x 3, m
Mat3 bend_softening(const BendConstraint& c, const Positions& x, HessianForm form);

}  // namespace piecework::model
