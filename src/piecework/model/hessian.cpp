#include <piecework/model/hessian.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace piecework::model {
namespace {

/// S^-1 from F, as accurate as F is: det(F^T F) is never formed. False if F is rank deficient, by
/// the measure of closest_isometry().
bool inverse_stretch(const Mat32& F, Mat2& B) {
  const double aa = F.col(0).squaredNorm();
  const double bb = F.col(1).squaredNorm();
  const double ab = F.col(0).dot(F.col(1));
  const double s = Vec3(F.col(0)).cross(Vec3(F.col(1))).norm();
  if (!(s > 1e-7 * (aa + bb))) return false;
  B << bb + s, -ab, -ab, aa + s;
  B /= s * std::sqrt(aa + bb + 2.0 * s);
  return B.allFinite();
}

/// S^-1 with eigenvalues above 1 set to 1, for any S = R^T F.
Mat2 clamped_inverse(const Mat2& S) {
  const double off = 0.5 * (S(0, 1) + S(1, 0));
  const double half_difference = 0.5 * (S(0, 0) - S(1, 1));
  const double middle = 0.5 * (S(0, 0) + S(1, 1));
  const double radius = std::hypot(half_difference, off);
  const double low = 1.0 / std::max(1.0, middle + radius);  // of the larger stretch
  const double high = 1.0 / std::max(1.0, middle - radius);
  Mat2 B = 0.5 * (low + high) * Mat2::Identity();
  if (!(radius > 0)) return B;
  const double k = 0.5 * (low - high) / radius;
  B(0, 0) += k * half_difference;
  B(1, 1) -= k * half_difference;
  B(0, 1) += k * off;
  B(1, 0) += k * off;
  return B;
}

}  // namespace

std::array<Vec2, 3> shape_gradients(const StretchConstraint& c) {
  const Vec2 g1 = c.rest_inverse.row(0).transpose();
  const Vec2 g2 = c.rest_inverse.row(1).transpose();
  return {-(g1 + g2), g1, g2};
}

StretchSoftening stretch_softening(const StretchConstraint& c, const Mat32& F, const Mat32& R,
                                   HessianForm form) {
  const Mat2 S = R.transpose() * F;
  const double trace = S.trace();
  Mat2 B;
  double twist = 2.0 / trace;
  if (form == HessianForm::Projected || !inverse_stretch(F, B)) {
    B = clamped_inverse(S);
    twist = trace > 2.0 ? twist : 1.0;
  }
  const auto G = shape_gradients(c);
  StretchSoftening result;
  result.normal = Vec3(R.col(0)).cross(Vec3(R.col(1)));
  const double scale = std::sqrt(0.5 * twist * c.weight);
  for (Eigen::Index a = 0; a < 3; ++a) {
    const Vec2& g = G[static_cast<std::size_t>(a)];
    result.twist.col(a) = scale * (g[1] * R.col(0) - g[0] * R.col(1));
    for (Eigen::Index b = 0; b < 3; ++b)
      result.bend(a, b) = c.weight * g.dot(B * G[static_cast<std::size_t>(b)]);
  }
  return result;
}

Mat3 bend_softening(const BendConstraint& c, const Positions& x, HessianForm form) {
  if (c.rest_length == 0) return Mat3::Zero();
  Vec3 v = Vec3::Zero();
  for (std::size_t k = 1; k < 4; ++k)
    v += c.coefficient[k] * (x.row(c.vertices[k]) - x.row(c.vertices[0])).transpose();
  const double length = v.norm();
  if (!(length > 1e-12 * c.rest_length)) return Mat3::Zero();
  double ratio = c.rest_length / length;
  if (form == HessianForm::Projected) ratio = std::min(1.0, ratio);
  const Vec3 u = v / length;
  return c.weight * ratio * (Mat3::Identity() - u * u.transpose());
}

}  // namespace piecework::model
