#include <piecework/model/projection.hpp>

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace piecework::model {
namespace {

/// A unit vector orthogonal to unit u, close to n x u if that exists.
Vec3 complete(const Vec3& u, const Vec3& n) {
  const Vec3 wanted = n.cross(u);
  return wanted.squaredNorm() > 1e-12 ? Vec3(wanted.normalized()) : u.unitOrthogonal();
}

}  // namespace

bool closest_isometry(const Mat32& F, Mat32& R) {
  const Vec3 a = F.col(0);
  const Vec3 b = F.col(1);
  const double aa = a.squaredNorm();
  const double bb = b.squaredNorm();
  const double ab = a.dot(b);
  // s = sigma_1 sigma_2 as an area: det(F^T F) would cancel.
  const double s = a.cross(b).norm();
  const double trace = aa + bb;
  if (!(s > 1e-7 * trace)) return false;  // NaN and overflow too
  // (F^T F)^1/2 = (C + s I) / tau and det(C + s I) = s tau^2.
  const double scale = 1.0 / (s * std::sqrt(trace + 2.0 * s));
  if (!std::isfinite(scale)) return false;
  R.col(0) = scale * ((bb + s) * a - ab * b);
  R.col(1) = scale * ((aa + s) * b - ab * a);
  return true;
}

Mat32 closest_isometry_degenerate(const Mat32& F, const Mat32& reference) {
  const double size = F.cwiseAbs().maxCoeff();
  if (!(size > 1e-100)) return reference;
  const Eigen::JacobiSVD<Mat32, Eigen::FullPivHouseholderQRPreconditioner> svd(
      F / size, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector2d& sigma = svd.singularValues();
  const Mat2& V = svd.matrixV();
  const Vec3 u1 = svd.matrixU().col(0);
  Vec3 u2 = svd.matrixU().col(1);
  if (sigma[1] < 1e-13 * sigma[0]) {
    const Vec3 normal = reference.col(0).cross(reference.col(1));
    u2 = complete(u1, normal) * (V.determinant() < 0 ? -1.0 : 1.0);
  }
  return u1 * V.col(0).transpose() + u2 * V.col(1).transpose();
}

Mat32 deformation_gradient(const StretchConstraint& c, const Positions& x) {
  Mat32 edges;
  edges.col(0) = (x.row(c.vertices[1]) - x.row(c.vertices[0])).transpose();
  edges.col(1) = (x.row(c.vertices[2]) - x.row(c.vertices[0])).transpose();
  return edges * c.rest_inverse;
}

bool project_stretch(const StretchConstraint& c, const Mat32& F, const Positions& previous,
                     const Positions& start, Mat32& R) {
  if (closest_isometry(F, R)) return false;
  Mat32 reference = Mat32::Identity();
  if (!closest_isometry(deformation_gradient(c, previous), reference))
    closest_isometry(deformation_gradient(c, start), reference);
  R = closest_isometry_degenerate(F, reference);
  return true;
}

}  // namespace piecework::model
