#include <piecework/model/projection.hpp>

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/SVD>

#include <piecework/core/random.hpp>

namespace piecework::model {
namespace {

Mat32 random_matrix(Random& random, double size) {
  Mat32 F;
  for (Eigen::Index i = 0; i < F.size(); ++i) F.data()[i] = random.uniform(-size, size);
  return F;
}

bool is_isometry(const Mat32& R) { return (R.transpose() * R - Mat2::Identity()).norm() < 1e-12; }

const Mat32 kReference = (Mat32() << 1, 0, 0, 0, 0, 1).finished();

TEST(ClosestIsometry, MatchesTheSingularValueDecomposition) {
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const Mat32 F = random_matrix(random, std::pow(10.0, random.uniform(-6, 6)));
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(F, Eigen::ComputeThinU | Eigen::ComputeThinV);
    Mat32 R;
    ASSERT_TRUE(closest_isometry(F, R));
    const double condition = svd.singularValues()[0] / svd.singularValues()[1];
    EXPECT_LT((R - svd.matrixU() * svd.matrixV().transpose()).norm(), 1e-14 * condition + 1e-13);
  }
}

TEST(ClosestIsometry, IsExactForAnIsometry) {
  Mat32 R;
  ASSERT_TRUE(closest_isometry(kReference, R));
  EXPECT_TRUE(R == kReference);
}

TEST(ClosestIsometry, RefusesDegenerateMatrices) {
  Mat32 R = Mat32::Constant(7);
  EXPECT_FALSE(closest_isometry(Mat32::Zero(), R));
  EXPECT_FALSE(closest_isometry((Mat32() << 1, 2, 1, 2, 1, 2).finished(), R));
  EXPECT_FALSE(closest_isometry(Mat32::Constant(std::nan("")), R));
  EXPECT_TRUE(R == Mat32::Constant(7)) << "the output was written";
}

TEST(DegenerateIsometry, ZeroTakesTheReference) {
  EXPECT_TRUE(closest_isometry_degenerate(Mat32::Zero(), kReference) == kReference);
}

// A triangle pressed into a line keeps the plane it had: the result agrees with F on the line and
// its normal is that of the reference.
TEST(DegenerateIsometry, LineKeepsTheReferenceNormal) {
  Random random(2);
  for (int i = 0; i < 500; ++i) {
    const double angle = random.uniform(0, 6.28);
    const Vec2 v(std::cos(random.uniform(0, 6.28)), 0.7);
    const Vec3 u(std::cos(angle), 0, std::sin(angle));  // in the reference plane y = 0
    const Mat32 F = std::pow(10.0, random.uniform(-9, 9)) * u * v.transpose();
    const Mat32 R = closest_isometry_degenerate(F, kReference);
    ASSERT_TRUE(is_isometry(R));
    EXPECT_GT((R.transpose() * u).dot(v.normalized()), 1 - 1e-9) << "not the closest on the line";
    EXPECT_GT(R.col(0).cross(R.col(1)).dot(kReference.col(0).cross(kReference.col(1))), 1 - 1e-9);
  }
}

TEST(DegenerateIsometry, LineAlongTheReferenceNormalStillGivesAnIsometry) {
  const Mat32 F = Vec3(0, 3, 0) * Vec2(1, 2).transpose();
  EXPECT_TRUE(is_isometry(closest_isometry_degenerate(F, kReference)));
}

TEST(DegenerateIsometry, NearlyDegenerateMatricesUseTheirOwnPlane) {
  const Mat32 F = (Mat32() << 1, 0, 0, 1e-9, 0, 0).finished();  // sigma ratio 1e-9
  const Mat32 R = closest_isometry_degenerate(F, kReference);
  EXPECT_LT((R - (Mat32() << 1, 0, 0, 1, 0, 0).finished()).norm(), 1e-6);
}

TEST(DegenerateIsometry, ExtremeSizes) {
  for (const double size : {1e-90, 1e-30, 1e30, 1e150})
    EXPECT_TRUE(is_isometry(
        closest_isometry_degenerate(size * (Mat32() << 1, 1, 0, 0, 0, 0).finished(), kReference)))
        << size;
}

}  // namespace
}  // namespace piecework::model
