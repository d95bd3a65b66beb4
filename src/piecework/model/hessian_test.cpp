#include <piecework/model/hessian.hpp>

#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <Eigen/Geometry>

#include <piecework/core/random.hpp>
#include <piecework/model/projection.hpp>
#include <piecework/testing/newton_oracle.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::model {
namespace {

constexpr double kHeavyStep = 1e6;  // s: takes the inertia out of the oracle's energy

mesh::TriangleMesh one_triangle() {
  mesh::TriangleMesh mesh;
  mesh.positions.resize(3, 3);
  mesh.positions << 0.1, 0, 0, 0.4, 0, 0.05, 0.2, 0, 0.3;
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}

/// Two triangles at an angle: the hinge is curved at rest.
mesh::TriangleMesh bent_pair() {
  mesh::TriangleMesh mesh;
  mesh.positions.resize(4, 3);
  mesh.positions << 0, 0, 0, 0.3, 0, 0, 0.1, 0.1, 0.25, 0.2, 0.05, -0.2;
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}};
  return mesh;
}

Eigen::MatrixXd stretch_hessian(const ClothModel& model, const Positions& x, HessianForm form) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * x.rows(), 3 * x.rows());
  for (const StretchConstraint& c : model.stretch) {
    const Mat32 F = deformation_gradient(c, x);
    Mat32 R;
    project_stretch(c, F, model.start, model.start, R);
    const auto softening = stretch_softening(c, F, R, form);
    const auto G = shape_gradients(c);
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b)
        H.block<3, 3>(3 * c.vertices[a], 3 * c.vertices[b]) +=
            c.weight * G[a].dot(G[b]) * Mat3::Identity() -
            softening.block(static_cast<int>(a), static_cast<int>(b));
  }
  return H;
}

Eigen::MatrixXd bend_hessian(const ClothModel& model, const Positions& x, HessianForm form) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * x.rows(), 3 * x.rows());
  for (const BendConstraint& c : model.bend) {
    const Mat3 M = c.weight * Mat3::Identity() - bend_softening(c, x, form);
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = 0; b < 4; ++b)
        H.block<3, 3>(3 * c.vertices[a], 3 * c.vertices[b]) +=
            c.coefficient[a] * c.coefficient[b] * M;
  }
  return H;
}

/// Central differences of the oracle's gradient.
Eigen::MatrixXd oracle_hessian(const mesh::TriangleMesh& rest, const Material& material,
                               const Positions& x) {
  const testing::OracleProblem problem{&rest, material, kHeavyStep, x,
                                       std::vector<char>(static_cast<std::size_t>(x.rows()), 0)};
  constexpr double step = 1e-5;
  Eigen::MatrixXd H(x.size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    Positions up = x;
    Positions down = x;
    up.data()[i] += step;
    down.data()[i] -= step;
    const Positions column =
        (oracle_gradient(problem, up) - oracle_gradient(problem, down)) / (2 * step);
    H.col(i) = Eigen::Map<const Eigen::VectorXd>(column.data(), column.size());
  }
  return H;
}

double lowest(const Eigen::MatrixXd& H) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(H).eigenvalues()[0];
}

struct Pose {
  const char* name;
  double along, across, shear;
  bool convex;  ///< the exact second derivative is positive semidefinite
};

class StretchHessian : public ::testing::TestWithParam<Pose> {
 protected:
  /// Deformed in its plane, then turned out of it.
  [[nodiscard]] Positions posed() const {
    Mat3 A = Mat3::Identity();
    A(0, 0) = GetParam().along;
    A(2, 2) = GetParam().across;
    A(0, 2) = GetParam().shear;
    const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, -0.5).normalized()).toRotationMatrix();
    return mesh_.positions * A.transpose() * turn.transpose();
  }
  mesh::TriangleMesh mesh_ = one_triangle();
  Material material_{.density = 0.5, .stretching = 100, .bending = std::nullopt};
  ClothModel model_ = testing::cloth_model(mesh_, material_);
};

TEST_P(StretchHessian, IsTheDerivativeOfTheGradient) {
  const Eigen::MatrixXd expected = oracle_hessian(mesh_, material_, posed());
  const Eigen::MatrixXd H = stretch_hessian(model_, posed(), HessianForm::Unprojected);
  EXPECT_LT((H - expected).norm(), 1e-6 * expected.norm());
  EXPECT_EQ(lowest(H) > -1e-9 * H.norm(), GetParam().convex);
}

TEST_P(StretchHessian, ProjectedIsSemidefiniteAndExactWhereItCanBe) {
  const Eigen::MatrixXd H = stretch_hessian(model_, posed(), HessianForm::Projected);
  const Eigen::MatrixXd exact = stretch_hessian(model_, posed(), HessianForm::Unprojected);
  EXPECT_GT(lowest(H), -1e-12 * H.norm());
  EXPECT_GT(lowest(H - exact), -1e-12 * H.norm()) << "an upper bound";
  if (GetParam().convex) {
    EXPECT_LT((H - exact).norm(), 1e-12 * exact.norm());
  } else {
    EXPECT_GT((H - exact).norm(), 1e-3 * exact.norm());
  }
}

INSTANTIATE_TEST_SUITE_P(Poses, StretchHessian,
                         ::testing::Values(Pose{"stretched", 1.2, 1.1, 0.1, true},
                                           Pose{"stretched once", 1.3, 0.9, 0, false},
                                           Pose{"compressed", 0.7, 0.8, 0, false},
                                           Pose{"sheared", 1, 1, 0.4, false},
                                           Pose{"thin", 1, 0.1, 0.2, false}),
                         [](const auto& pose) {
                           std::string name = pose.param.name;
                           std::erase(name, ' ');
                           return name;
                         });

TEST(StretchHessianAtRest, ResistsNothingOutOfThePlane) {
  const auto mesh = one_triangle();
  const auto model = testing::cloth_model(mesh, {.density = 0.5, .stretching = 100});
  const Eigen::MatrixXd H = stretch_hessian(model, mesh.positions, HessianForm::Unprojected);
  Eigen::VectorXd up = Eigen::VectorXd::Zero(9);
  up[1] = 1;
  EXPECT_LT((H * up).norm(), 1e-12 * H.norm());
}

TEST(StretchHessianOfDegenerateTriangles, IsFiniteAndSemidefinite) {
  const auto mesh = one_triangle();
  const auto model = testing::cloth_model(mesh, {.density = 0.5, .stretching = 100});
  Positions line = mesh.positions;
  line.col(2).setZero();
  for (const Positions& x : {Positions(Positions::Zero(3, 3)), line, Positions(1e-200 * line)})
    for (const HessianForm form : {HessianForm::Projected, HessianForm::Unprojected}) {
      const Eigen::MatrixXd H = stretch_hessian(model, x, form);
      ASSERT_TRUE(H.allFinite());
      EXPECT_GT(lowest(H), -1e-12 * H.norm());
    }
}

TEST(BendHessian, IsTheDerivativeOfTheGradient) {
  const auto mesh = bent_pair();
  const Material bending{.density = 0.5, .stretching = 0, .bending = 0.3};
  const auto model = testing::cloth_model(mesh, bending);
  ASSERT_EQ(model.bend.size(), 1u);
  ASSERT_GT(model.bend[0].rest_length, 0);
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    const Positions x = mesh.positions + testing::random_positions(4, 0.05, seed);
    const Eigen::MatrixXd expected = oracle_hessian(mesh, bending, x);
    const Eigen::MatrixXd exact = bend_hessian(model, x, HessianForm::Unprojected);
    const Eigen::MatrixXd projected = bend_hessian(model, x, HessianForm::Projected);
    EXPECT_LT((exact - expected).norm(), 1e-6 * expected.norm()) << seed;
    EXPECT_GT(lowest(projected), -1e-12 * projected.norm()) << seed;
    if (lowest(exact) > -1e-12 * exact.norm()) {
      EXPECT_LT((projected - exact).norm(), 1e-12 * exact.norm()) << seed;
    }
  }
}

TEST(BendHessian, AHingeThatIsMomentarilyFlatIsFinite) {
  const auto model =
      testing::cloth_model(bent_pair(), {.density = 0.5, .stretching = 0, .bending = 0.3});
  const Eigen::MatrixXd H = bend_hessian(model, Positions::Zero(4, 3), HessianForm::Unprojected);
  EXPECT_TRUE(H.allFinite());
  EXPECT_GT(lowest(H), -1e-12 * H.norm());
}

}  // namespace
}  // namespace piecework::model
