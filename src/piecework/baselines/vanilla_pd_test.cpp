#include <piecework/baselines/vanilla_pd.hpp>

#include <gtest/gtest.h>

#include <piecework/baselines/step_test_util.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/testing/newton_oracle.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::baselines {
namespace {

using model::StopRule;

constexpr double kH = kTestH;
constexpr double kGravity = kTestGravity;

struct Problem : TestStep {
  using TestStep::TestStep;
  model::StepReport solve(model::StopOptions stop, Positions& x) const {
    return TestStep::solve<VanillaPd>(stop, x);
  }
};

class VanillaPdAgainstNewton : public ::testing::TestWithParam<int> {};

// The energy is not convex, so Newton starts from the PD solution: if PD's is a minimum, Newton
// stays there.
TEST_P(VanillaPdAgainstNewton, FindsAMinimumOfTheIncrementalPotential) {
  const int kind = GetParam();
  const Problem p(
      kind == 2 ? testing::sphere_mesh(1, 0.3) : testing::grid_mesh(5, 5, 0.3),
      {.density = 0.5, .stretching = 20, .bending = kind == 0 ? std::nullopt : std::optional(1e-3)},
      0.01);
  Positions x;
  const auto report = p.solve({StopRule::Gradient, 1e-11, 20000, 1}, x);
  ASSERT_TRUE(report.converged) << report.gradient;
  const Positions newton = p.oracle(x);
  const double motion = (x - p.z).cwiseAbs().maxCoeff();
  ASSERT_GT(motion, 1e-4) << "nothing moved, nothing was tested";
  EXPECT_LT((x - newton).cwiseAbs().maxCoeff(), 1e-8 * 0.3);
}

INSTANTIATE_TEST_SUITE_P(MembraneBendingCurved, VanillaPdAgainstNewton, ::testing::Values(0, 1, 2));

TEST(VanillaPd, EnergyNeverRises) {
  const Problem p(testing::grid_mesh(10, 10), testing::cotton(1e-3), 0.02);
  double last = std::numeric_limits<double>::infinity();
  for (int iterations = 1; iterations < 40; ++iterations) {
    Positions x;
    const double energy = p.solve({StopRule::Iterations, 0, iterations, 1}, x).energy;
    EXPECT_LE(energy, last * (1 + 1e-12)) << iterations;
    last = energy;
  }
}

TEST(VanillaPd, FixedVerticesKeepTheirBits) {
  const Problem p(testing::grid_mesh(6, 6), testing::cotton(), 0.02);
  Positions x;
  (void)p.solve({StopRule::Iterations, 0, 10, 1}, x);
  EXPECT_TRUE(x.row(0) == p.rest.positions.row(0));
  EXPECT_TRUE(x.row(1) == p.rest.positions.row(1));
  EXPECT_FALSE(x.row(2) == p.z.row(2));
}

TEST(VanillaPd, StopRulesStopWhereTheySay) {
  const Problem p(testing::grid_mesh(8, 8), testing::cotton(1e-3), 0.01);
  Positions x;
  EXPECT_EQ(p.solve({StopRule::Iterations, 0, 7, 1}, x).iterations, 7);
  const auto gradient = p.solve({StopRule::Gradient, 1e-2, 2000, 1}, x);
  EXPECT_TRUE(gradient.converged);
  EXPECT_LE(gradient.gradient, 1e-2);
  const auto dx = p.solve({StopRule::Dx2, 1e-3, 2000, 1}, x);
  EXPECT_TRUE(dx.converged);
  EXPECT_LE(dx.dx_2, 1e-3);
  EXPECT_LE(p.solve({StopRule::DxInf, 1e-3, 2000, 1}, x).iterations, dx.iterations);
  EXPECT_LE(p.solve({StopRule::DxRms, 1e-3, 2000, 1}, x).iterations, dx.iterations);
  EXPECT_EQ(p.solve({StopRule::DxInf, 1e3, 2000, 5}, x).iterations, 5) << "min_iterations";
  const auto cut = p.solve({StopRule::Gradient, 1e-12, 3, 1}, x);
  EXPECT_FALSE(cut.converged);
  EXPECT_EQ(cut.iterations, 3);
}

// The estimate must bound the true error up to a small factor, or the default rule is a lie.
TEST(VanillaPd, ErrorEstimateIsHonest) {
  const Problem p(testing::grid_mesh(12, 12), {.density = 0.5, .stretching = 50, .bending = 1e-4},
                  0.01);
  Positions exact;
  ASSERT_TRUE(p.solve({StopRule::Gradient, 1e-11, 100000, 1}, exact).converged);
  for (const double tolerance : {1e-1, 1e-2, 1e-3}) {
    Positions x;
    const auto report = p.solve({StopRule::Error, tolerance, 100000, 1}, x);
    ASSERT_TRUE(report.converged);
    const double error = (x - exact).rowwise().norm().maxCoeff() / p.model.mean_edge;
    EXPECT_LT(error, 3 * tolerance) << tolerance;
    EXPECT_GT(report.iterations, 1);
  }
}

TEST(VanillaPd, EverythingFixedIsSolvedAtOnce) {
  Problem p(testing::grid_mesh(4, 4), testing::cotton(), 0.0);
  p.fixed.assign(16, 1);
  Positions x;
  const auto report = p.solve({}, x);
  EXPECT_TRUE(report.converged);
  EXPECT_TRUE(x == p.z);
}

TEST(VanillaPd, NothingFixedWorks) {
  Problem p(testing::grid_mesh(5, 5), testing::cotton(), 0.01);
  p.fixed.assign(25, 0);
  Positions x;
  const auto report = p.solve({StopRule::Gradient, 1e-6, 5000, 1}, x);
  EXPECT_TRUE(report.converged);
  // No external work: the centre of mass stays at that of z.
  EXPECT_LT((p.model.mass.transpose() * (x - p.z)).norm() / p.model.mass.sum(), 1e-10);
}

TEST(VanillaPd, FactorsOnlyWhenTheFixedSetChanges) {
  Problem p(testing::grid_mesh(6, 6), testing::cotton(), 0.01);
  VanillaPd solver(p.model, kH, kGravity, {StopRule::Iterations, 0, 3, 1});
  Positions x = p.z;
  EXPECT_GE(solver.minimize({&p.z, &p.fixed, &p.model.start}, x).phases.refactor, 0);
  EXPECT_LT(solver.minimize({&p.z, &p.fixed, &p.model.start}, x).phases.refactor, 0)
      << "must be off: '-'";
  p.fixed[1] = 0;
  EXPECT_GE(solver.minimize({&p.z, &p.fixed, &p.model.start}, x).phases.refactor, 0);
}

TEST(VanillaPd, SameBitsForEveryThreadCount) {
  const Problem p(testing::grid_mesh(50, 50), testing::cotton(), 0.01);
  const auto run = [&](int threads) {
    return ThreadPool(threads).run([&] {
      Positions x;
      (void)p.solve({StopRule::Iterations, 0, 8, 1}, x);
      return x;
    });
  };
  const Positions expected = run(1);
  for (const int threads : {2, 4, 8, 8}) EXPECT_TRUE(run(threads) == expected) << threads;
}

}  // namespace
}  // namespace piecework::baselines
