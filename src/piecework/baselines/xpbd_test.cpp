#include <piecework/baselines/xpbd.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <piecework/baselines/step_test_util.hpp>
#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::baselines {
namespace {

using model::StopRule;

constexpr XpbdOptions kNorm{XpbdStretch::Norm};
constexpr XpbdOptions kFrame{XpbdStretch::Frame};
constexpr model::StopOptions kUntilStill{StopRule::DxInf, 1e-12, 20000, 1};

TEST(Coloring, NeighboursDifferAndNothingIsLost) {
  const std::vector<int> begin{0, 2, 4, 6, 8};
  const std::vector<int> vertices{0, 1, 1, 2, 2, 3, 3, 0};  // a ring of four edges
  const Coloring all = color_greedily(begin, vertices, {1, 1, 1, 1});
  EXPECT_EQ(all.num_colors(), 2);
  EXPECT_EQ(all.item, (std::vector<int>{0, 2, 1, 3}));
  const Coloring one_held = color_greedily(begin, vertices, {0, 1, 0, 1});
  EXPECT_EQ(one_held.num_colors(), 2);
  EXPECT_EQ(color_greedily(begin, vertices, {0, 0, 0, 0}).num_colors(), 1);
  EXPECT_EQ(color_greedily(std::vector<int>{0}, {}, {}).num_colors(), 0);
}

// Flat hinges alone have constant gradients: there XPBD is exact Gauss-Seidel on the dual problem.
TEST(Xpbd, WithFlatHingesAloneFindsTheMinimum) {
  const TestStep step(testing::grid_mesh(6, 6, 0.3),
                      {.density = 0.5, .stretching = 0, .bending = 1e-4}, 0.01);
  Positions pd;
  ASSERT_TRUE(step.solve<VanillaPd>({StopRule::Gradient, 1e-11, 100, 1}, pd).converged);
  Positions x;
  EXPECT_TRUE(step.solve<Xpbd>({StopRule::DxInf, 1e-14, 100000, 1}, x).converged);
  ASSERT_GT(largest_distance(x, step.z), 1e-4) << "it moves";
  EXPECT_LT(largest_distance(x, pd), 1e-9);
}

class XpbdNearTheMinimum : public ::testing::TestWithParam<int> {};

// R is held while a triangle is solved, so gradients are constant: exact Gauss-Seidel on the dual
// problem of projective dynamics.
TEST_P(XpbdNearTheMinimum, WithFramesFindsIt) {
  const TestStep step = small_step(GetParam());
  Positions minimum;
  ASSERT_TRUE(step.solve<VanillaPd>({StopRule::Gradient, 1e-11, 20000, 1}, minimum).converged);
  Positions x;
  const auto report = step.solve<Xpbd>(kUntilStill, x, kFrame);
  EXPECT_TRUE(report.converged) << report.dx_inf;
  const double motion = largest_distance(minimum, step.z);
  // A curved hinge still is one number whose gradient turns.
  EXPECT_LT(largest_distance(x, minimum), (GetParam() == 2 ? 0.2 : 1e-8) * motion);
}

// The end is near the minimum, though not at it: gradients of |F - R| turn a lot.
TEST_P(XpbdNearTheMinimum, WithNormsEndsNearItAndStays) {
  const TestStep step = small_step(GetParam());
  Positions minimum;
  ASSERT_TRUE(step.solve<VanillaPd>({StopRule::Gradient, 1e-11, 20000, 1}, minimum).converged);
  Positions x;
  const auto report = step.solve<Xpbd>(kUntilStill, x, kNorm);
  EXPECT_TRUE(report.converged) << report.dx_inf;
  const double motion = largest_distance(minimum, step.z);
  EXPECT_LT(largest_distance(x, minimum), 0.5 * motion);
  EXPECT_GT(largest_distance(x, minimum), 1e-6 * motion) << "the documented limit has gone";
}

TEST_P(XpbdNearTheMinimum, ConstraintResidualsFall) {
  const TestStep step = small_step(GetParam());
  for (const XpbdOptions& options : {kNorm, kFrame}) {
    std::vector<double> residual;
    for (const int sweeps : {1, 2, 4, 8, 16, 32}) {
      Xpbd xpbd(step.model, kTestH, kTestGravity, {StopRule::Iterations, 0, sweeps, 1}, options);
      Positions x = step.z;
      (void)xpbd.minimize(step.problem(), x);
      residual.push_back(xpbd.constraint_residual());
    }
    for (std::size_t k = 1; k < residual.size(); ++k)
      EXPECT_LT(residual[k], std::max(residual[k - 1], 1e-20 * residual[0])) << k;
    EXPECT_LT(residual.back(), 1e-6 * residual[0]);
  }
}

INSTANTIATE_TEST_SUITE_P(MembraneBendingCurved, XpbdNearTheMinimum, ::testing::Values(0, 1, 2));

TEST(Xpbd, StiffClothDoesNotBlowUp) {
  const TestStep step(testing::grid_mesh(12, 12, 0.3),
                      {.density = 0.1, .stretching = 1e7, .bending = 1.0}, 0.02);
  for (const XpbdOptions& options : {kNorm, kFrame}) {
    Positions x;
    const auto first = step.solve<Xpbd>({StopRule::Iterations, 0, 1, 1}, x, options);
    const auto report = step.solve<Xpbd>({StopRule::Iterations, 0, 500, 1}, x, options);
    EXPECT_TRUE(x.allFinite());
    EXPECT_LT((x - step.rest.positions).cwiseAbs().maxCoeff(), 0.3);
    EXPECT_LT(report.energy, first.energy);
  }
}

TEST(Xpbd, CrumpledToALineOrAPoint) {
  for (const int kind : {0, 1, 2}) {
    TestStep step = small_step(kind);
    step.fixed.assign(step.fixed.size(), 0);
    for (const bool point : {false, true}) {
      step.z = step.rest.positions;
      for (const int axis : {1, 2}) step.z.col(axis).setZero();
      if (point) step.z.setZero();
      Positions x;
      for (const XpbdOptions& options : {kNorm, kFrame}) {
        const auto report = step.solve<Xpbd>({StopRule::Iterations, 0, 100, 1}, x, options);
        EXPECT_TRUE(x.allFinite());
        EXPECT_TRUE(std::isfinite(report.energy));
      }
    }
  }
}

TEST(Xpbd, FixedVerticesKeepTheirBitsAndPinsMayChange) {
  TestStep step(testing::grid_mesh(6, 6), testing::cotton(), 0.02);
  Xpbd method(step.model, kTestH, kTestGravity, {StopRule::Iterations, 0, 30, 1});
  for (const std::vector<int>& held : {std::vector<int>{0, 1}, {0}, {}, {5, 30, 35}}) {
    step.fixed.assign(step.fixed.size(), 0);
    step.hold(held);
    Positions x = step.z;
    (void)method.minimize(step.problem(), x);
    for (const int v : held) EXPECT_TRUE(x.row(v) == step.rest.positions.row(v));
    Positions fresh;
    (void)step.solve<Xpbd>({StopRule::Iterations, 0, 30, 1}, fresh);
    EXPECT_TRUE(x == fresh) << "no trace of the pins before";
  }
}

TEST(Xpbd, EverythingFixedIsSolvedAtOnce) {
  TestStep step(testing::grid_mesh(4, 4), testing::cotton(), 0.0);
  step.fixed.assign(16, 1);
  Positions x;
  EXPECT_TRUE(step.solve<Xpbd>({}, x).converged);
  EXPECT_TRUE(x == step.z);
}

// Only internal forces act between z and the end.
TEST(Xpbd, ConservesMomentum) {
  TestStep step(testing::grid_mesh(8, 8), testing::cotton(1e-3), 0.02);
  step.fixed.assign(step.fixed.size(), 0);
  Positions x;
  (void)step.solve<Xpbd>({StopRule::Iterations, 0, 50, 1}, x);
  ASSERT_GT(largest_distance(x, step.z), 1e-3);
  EXPECT_LT((step.model.mass.transpose() * (x - step.z)).norm() / step.model.mass.sum(), 1e-12);
}

TEST(Xpbd, SameBitsForEveryThreadCount) {
  const TestStep step(testing::grid_mesh(50, 50), testing::cotton(), 0.01);
  for (const XpbdOptions& options : {kNorm, kFrame}) {
    const auto run = [&](int threads) {
      return ThreadPool(threads).run([&] {
        Positions x;
        (void)step.solve<Xpbd>({StopRule::Iterations, 0, 20, 1}, x, options);
        return x;
      });
    };
    const Positions expected = run(1);
    for (const int threads : {2, 3, 8, 8}) EXPECT_TRUE(run(threads) == expected) << threads;
  }
}

}  // namespace
}  // namespace piecework::baselines
