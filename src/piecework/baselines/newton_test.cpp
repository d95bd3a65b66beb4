#include <piecework/baselines/newton.hpp>

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/baselines/step_test_util.hpp>
#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::baselines {
namespace {

using model::HessianForm;
using model::StopRule;

constexpr NewtonOptions kProjected{};
constexpr NewtonOptions kUnprojected{.hessian = HessianForm::Unprojected};
constexpr NewtonOptions kPcg{.linear = NewtonLinear::Pcg};
constexpr NewtonOptions kUnprojectedPcg{HessianForm::Unprojected, NewtonLinear::Pcg};
constexpr NewtonOptions kAll[] = {kProjected, kUnprojected, kPcg, kUnprojectedPcg};

class NewtonAgainstOracle : public ::testing::TestWithParam<int> {};

TEST_P(NewtonAgainstOracle, FindsAMinimumOfTheIncrementalPotential) {
  const TestStep step = small_step(GetParam());
  for (const NewtonOptions& options : kAll) {
    Positions x;
    const auto report = step.solve<Newton>({StopRule::Gradient, 1e-11, 500, 1}, x, options);
    ASSERT_TRUE(report.converged) << report.gradient;
    ASSERT_GT(largest_distance(x, step.z), 1e-4) << "nothing moved, nothing was tested";
    EXPECT_LT(largest_distance(x, step.oracle(x)), 1e-9 * 0.3);
  }
}

// The same valley as projective dynamics, whose steps are short, from the same start.
TEST_P(NewtonAgainstOracle, AgreesWithProjectiveDynamics) {
  const TestStep step = small_step(GetParam());
  Positions pd;
  ASSERT_TRUE(step.solve<VanillaPd>({StopRule::Gradient, 1e-11, 20000, 1}, pd).converged);
  for (const NewtonOptions& options : kAll) {
    Positions x;
    ASSERT_TRUE(step.solve<Newton>({StopRule::Gradient, 1e-11, 500, 1}, x, options).converged);
    EXPECT_LT(largest_distance(x, pd), 1e-9 * 0.3);
  }
}

INSTANTIATE_TEST_SUITE_P(MembraneBendingCurved, NewtonAgainstOracle, ::testing::Values(0, 1, 2));

// Gradients of successive iterations near the minimum: the exponent of g_{k+1} = C g_k^p.
TEST(Newton, UnprojectedConvergesQuadratically) {
  const TestStep step(testing::grid_mesh(10, 10), testing::cotton(1e-3), 0.02);
  std::vector<double> gradient;
  for (int iterations = 1; iterations < 20; ++iterations) {
    Positions x;
    gradient.push_back(
        step.solve<Newton>({StopRule::Iterations, 0, iterations, 1}, x, kUnprojected).gradient);
    if (gradient.back() < 1e-6) break;  // one more meets rounding
  }
  ASSERT_LT(gradient.back(), 1e-6);
  ASSERT_GE(gradient.size(), 3u);
  const auto last = gradient.end() - 1;
  EXPECT_GT(std::log(last[0] / last[-1]) / std::log(last[-1] / last[-2]), 1.6);
}

TEST(Newton, EnergyNeverRises) {
  for (const NewtonOptions& options : kAll) {
    const TestStep step(testing::grid_mesh(10, 10), testing::cotton(1e-3), 0.05);
    double last = std::numeric_limits<double>::infinity();
    for (int iterations = 1; iterations < 25; ++iterations) {
      Positions x;
      const double energy =
          step.solve<Newton>({StopRule::Iterations, 0, iterations, 1}, x, options).energy;
      EXPECT_LE(energy, last * (1 + 1e-11)) << iterations;
      last = energy;
    }
  }
}

TEST(Newton, SurvivesRoundingNearConvergence) {
  for (const NewtonOptions& options : kAll) {
    TestStep step(testing::grid_mesh(10, 10), testing::cotton(1e-3), 0.01);
    step.z.rowwise() += Eigen::RowVector3d(100, 200, 300);  // m: coordinates lose digits
    step.fixed.assign(step.fixed.size(), 0);
    Positions x;
    const auto report = step.solve<Newton>({StopRule::Iterations, 0, 60, 1}, x, options);
    EXPECT_LT(report.gradient, 1e-7);
    EXPECT_TRUE(x.allFinite());
  }
}

TEST(Newton, CrumpledToALineOrAPoint) {
  for (const int kind : {0, 1, 2})
    for (const NewtonOptions& options : kAll) {
      TestStep step = small_step(kind);
      step.fixed.assign(step.fixed.size(), 0);
      for (const bool point : {false, true}) {
        step.z = step.rest.positions;
        for (const int axis : {1, 2}) step.z.col(axis).setZero();
        if (point) step.z.setZero();
        Positions x;
        const auto report = step.solve<Newton>({StopRule::Gradient, 1e-6, 300, 1}, x, options);
        EXPECT_GT(report.iterations, 0);
        EXPECT_TRUE(x.allFinite());
        EXPECT_TRUE(std::isfinite(report.energy));
      }
    }
}

TEST(Newton, ReportsDegenerateTriangles) {
  TestStep step = small_step(1);
  step.z.setZero();
  step.fixed.assign(step.fixed.size(), 1);
  Positions x;
  EXPECT_EQ(step.solve<Newton>({}, x).degenerate_projections,
            static_cast<int>(step.rest.triangles.size()));
}

TEST(Newton, FixedVerticesKeepTheirBitsAndPinsMayChange) {
  TestStep step(testing::grid_mesh(6, 6), testing::cotton(), 0.02);
  for (const NewtonOptions& options : kAll) {
    Newton newton(step.model, kTestH, kTestGravity, {StopRule::Gradient, 1e-9, 100, 1}, options);
    for (const std::vector<int>& held : {std::vector<int>{0, 1}, {0}, {}, {5, 30, 35}}) {
      step.fixed.assign(step.fixed.size(), 0);
      step.hold(held);
      Positions x = step.z;
      EXPECT_TRUE(newton.minimize(step.problem(), x).converged);
      for (const int v : held) EXPECT_TRUE(x.row(v) == step.rest.positions.row(v));
      Positions fresh;
      (void)step.solve<Newton>({StopRule::Gradient, 1e-9, 100, 1}, fresh, options);
      EXPECT_TRUE(x == fresh) << "no trace of the pins before";
    }
  }
}

TEST(Newton, EverythingFixedIsSolvedAtOnce) {
  TestStep step(testing::grid_mesh(4, 4), testing::cotton(), 0.0);
  step.fixed.assign(16, 1);
  for (const NewtonOptions& options : kAll) {
    Positions x;
    EXPECT_TRUE(step.solve<Newton>({}, x, options).converged);
    EXPECT_TRUE(x == step.z);
  }
}

// The estimate must bound the true error up to a small factor, or the default rule is a lie.
TEST(Newton, ErrorEstimateIsHonest) {
  const TestStep step(testing::grid_mesh(12, 12),
                      {.density = 0.5, .stretching = 50, .bending = 1e-4}, 0.01);
  for (const NewtonOptions& options : kAll) {
    Positions exact;
    ASSERT_TRUE(step.solve<Newton>({StopRule::Gradient, 1e-11, 500, 1}, exact, options).converged);
    for (const double tolerance : {1e-1, 1e-2, 1e-3, 1e-6}) {
      Positions x;
      const auto report = step.solve<Newton>({StopRule::Error, tolerance, 500, 1}, x, options);
      ASSERT_TRUE(report.converged);
      EXPECT_LT(largest_distance(x, exact) / step.model.mean_edge, 3 * tolerance) << tolerance;
    }
  }
}

TEST(Newton, SameBitsForEveryThreadCount) {
  const TestStep step(testing::grid_mesh(40, 40), testing::cotton(), 0.01);
  for (const NewtonOptions& options : kAll) {
    const auto run = [&](int threads) {
      return ThreadPool(threads).run([&] {
        Positions x;
        (void)step.solve<Newton>({StopRule::Iterations, 0, 4, 1}, x, options);
        return x;
      });
    };
    const Positions expected = run(1);
    for (const int threads : {2, 3, 8, 8}) EXPECT_TRUE(run(threads) == expected) << threads;
  }
}

TEST(HessianMatrix, ScalarsAndTheProductAreTheBlocks) {
  const TestStep step = small_step(2);
  model::HessianMatrix H(step.model);
  const model::Reduction reduction(step.model, step.fixed);
  H.set_pattern(reduction, reduction.system(assemble_system(step.model, kTestH)));
  H.assemble(step.z, step.problem(), HessianForm::Unprojected);
  const Eigen::MatrixXd dense = Eigen::MatrixXd(H.scalars()).selfadjointView<Eigen::Lower>();
  const Positions x = testing::random_positions(H.count(), 1, 3);
  Positions y;
  H.multiply(x, y);
  const Eigen::VectorXd expected = dense * Eigen::Map<const Eigen::VectorXd>(x.data(), x.size());
  EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(y.data(), y.size()) - expected).norm(),
            1e-13 * expected.norm());
}

}  // namespace
}  // namespace piecework::baselines
