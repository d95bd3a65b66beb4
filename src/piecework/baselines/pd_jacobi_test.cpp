#include <piecework/baselines/pd_jacobi.hpp>

#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/baselines/step_test_util.hpp>
#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::baselines {
namespace {

using model::StopRule;

class PdJacobiAgainstOracle : public ::testing::TestWithParam<int> {};

TEST_P(PdJacobiAgainstOracle, FindsTheMinimumOfProjectiveDynamics) {
  const TestStep step = small_step(GetParam());
  Positions pd;
  ASSERT_TRUE(step.solve<VanillaPd>({StopRule::Gradient, 1e-11, 20000, 1}, pd).converged);
  for (const PdJacobiOptions& options :
       {PdJacobiOptions{}, PdJacobiOptions{.rho = 0.0}, PdJacobiOptions{.rho = 0.9999}}) {
    Positions x;
    const auto report = step.solve<PdJacobi>({StopRule::Gradient, 1e-11, 100000, 1}, x, options);
    ASSERT_TRUE(report.converged) << report.gradient;
    ASSERT_GT(largest_distance(x, step.z), 1e-4) << "nothing moved, nothing was tested";
    EXPECT_LT(largest_distance(x, step.oracle(x)), 1e-8 * 0.3);
    EXPECT_LT(largest_distance(x, pd), 1e-8 * 0.3);
  }
}

INSTANTIATE_TEST_SUITE_P(MembraneBendingCurved, PdJacobiAgainstOracle, ::testing::Values(0, 1, 2));

TEST(PdJacobi, EnergyNeverRises) {
  const TestStep step(testing::grid_mesh(10, 10), testing::cotton(1e-3), 0.05);
  for (const PdJacobiOptions& options : {PdJacobiOptions{}, PdJacobiOptions{.rho = 0.99999}}) {
    double last = std::numeric_limits<double>::infinity();
    for (int iterations = 1; iterations < 120; ++iterations) {
      Positions x;
      const double energy =
          step.solve<PdJacobi>({StopRule::Iterations, 0, iterations, 1}, x, options).energy;
      EXPECT_LE(energy, last * (1 + 1e-11)) << iterations;
      last = energy;
    }
  }
}

// The sequence overshoots with a rho above the truth; dropped iterates are seen in the solves.
TEST(PdJacobi, DropsIteratesThatWouldRaiseTheEnergy) {
  const TestStep step(testing::grid_mesh(10, 10), testing::cotton(1e-3), 0.05);
  Positions x;
  const auto report =
      step.solve<PdJacobi>({StopRule::Iterations, 0, 300, 1}, x, PdJacobiOptions{.rho = 0.99999});
  EXPECT_LT(report.global_solves, report.iterations);
  EXPECT_GT(report.global_solves, report.iterations / 2);
}

TEST(PdJacobi, WeightsPay) {
  const TestStep step(testing::grid_mesh(20, 20), testing::cotton(1e-3), 0.02);
  Positions x;
  const auto plain =
      step.solve<PdJacobi>({StopRule::Gradient, 1e-4, 20000, 1}, x, PdJacobiOptions{.rho = 0.0});
  const auto weighted = step.solve<PdJacobi>({StopRule::Gradient, 1e-4, 20000, 1}, x);
  ASSERT_TRUE(plain.converged && weighted.converged);
  EXPECT_LT(3 * weighted.iterations, plain.iterations);
}

TEST(PdJacobi, KnowsTheLargestEigenvalue) {
  const TestStep step(testing::grid_mesh(8, 8), testing::cotton(1e-3), 0.02);
  PdJacobi method(step.model, kTestH, kTestGravity, {});
  method.prepare(step.fixed);
  const Eigen::MatrixXd K =
      model::Reduction(step.model, step.fixed).system(assemble_system(step.model, kTestH));
  const Eigen::VectorXd scale = K.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * K * scale.asDiagonal();
  const double exact =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled).eigenvalues().maxCoeff();
  EXPECT_LE(method.largest_eigenvalue(), exact * (1 + 1e-12));
  EXPECT_GT(method.largest_eigenvalue(), 0.95 * exact);
}

TEST(PdJacobi, CrumpledToALineOrAPoint) {
  for (const int kind : {0, 1, 2}) {
    TestStep step = small_step(kind);
    step.fixed.assign(step.fixed.size(), 0);
    for (const bool point : {false, true}) {
      step.z = step.rest.positions;
      for (const int axis : {1, 2}) step.z.col(axis).setZero();
      if (point) step.z.setZero();
      Positions x;
      const auto report = step.solve<PdJacobi>({StopRule::Gradient, 1e-6, 500, 1}, x);
      EXPECT_TRUE(x.allFinite());
      EXPECT_TRUE(std::isfinite(report.energy));
    }
  }
}

TEST(PdJacobi, FixedVerticesKeepTheirBitsAndPinsMayChange) {
  TestStep step(testing::grid_mesh(6, 6), testing::cotton(), 0.02);
  PdJacobi method(step.model, kTestH, kTestGravity, {StopRule::Gradient, 1e-8, 20000, 1});
  for (const std::vector<int>& held : {std::vector<int>{0, 1}, {0}, {}, {5, 30, 35}}) {
    step.fixed.assign(step.fixed.size(), 0);
    step.hold(held);
    Positions x = step.z;
    EXPECT_TRUE(method.minimize(step.problem(), x).converged);
    for (const int v : held) EXPECT_TRUE(x.row(v) == step.rest.positions.row(v));
    Positions fresh;
    (void)step.solve<PdJacobi>({StopRule::Gradient, 1e-8, 20000, 1}, fresh);
    EXPECT_TRUE(x == fresh) << "no trace of the pins before";
  }
}

TEST(PdJacobi, EverythingFixedIsSolvedAtOnce) {
  TestStep step(testing::grid_mesh(4, 4), testing::cotton(), 0.0);
  step.fixed.assign(16, 1);
  Positions x;
  EXPECT_TRUE(step.solve<PdJacobi>({}, x).converged);
  EXPECT_TRUE(x == step.z);
}

TEST(PdJacobi, SameBitsForEveryThreadCount) {
  const TestStep step(testing::grid_mesh(50, 50), testing::cotton(), 0.01);
  const auto run = [&](int threads) {
    return ThreadPool(threads).run([&] {
      Positions x;
      (void)step.solve<PdJacobi>({StopRule::Iterations, 0, 40, 1}, x);
      return x;
    });
  };
  const Positions expected = run(1);
  for (const int threads : {2, 3, 8, 8}) EXPECT_TRUE(run(threads) == expected) << threads;
}

}  // namespace
}  // namespace piecework::baselines
