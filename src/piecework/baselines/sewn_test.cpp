// Sewn cloth in motion: against one sheet without seams, thread by thread, open seams that close.

#include <algorithm>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/baselines/newton.hpp>
#include <piecework/baselines/pd_jacobi.hpp>
#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/baselines/xpbd.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/integrator.hpp>
#include <piecework/model/measures.hpp>
#include <piecework/testing/patchwork.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::baselines {
namespace {

constexpr double kH = 1.0 / 120.0;

model::ClothModel sewn_model(const std::vector<testing::Patch>& patches, double close_time = 0,
                             const Vec3& shift = Vec3::Zero()) {
  auto model = testing::cloth_model(testing::patchwork(patches), testing::cotton(std::nullopt));
  const int first = patches.front().columns * patches.front().rows;
  model.start.bottomRows(model.num_vertices() - first).rowwise() += shift.transpose();
  auto stitches = testing::geometric_stitches(patches);
  for (mesh::Stitch& stitch : stitches) stitch.close_time = close_time;
  model.sewing = model::Sewing(
      mesh::resolve_seams(stitches, model.num_vertices(), testing::plain_names()), model.start);
  return model;
}

struct Motion {
  explicit Motion(const model::ClothModel& model, std::vector<int> held,
                  std::optional<Vec3> gravity = Vec3(0, -9.81, 0))
      : integrator(model, forces(gravity), {{.vertices = std::move(held)}}, {.h = kH},
                   std::make_unique<VanillaPd>(
                       model, kH, 9.81,
                       model::StopOptions{model::StopRule::Iterations, 0, /*max_iterations=*/25})),
        state(integrator.initial_state({})) {}
  static model::ExternalForces forces(std::optional<Vec3> gravity) {
    model::ExternalForces all;
    all.gravity = gravity;
    if (gravity) all.wind = model::Wind{.velocity = {0.5, 0, 2}};
    return all;
  }
  void advance(int steps) {
    for (int i = 0; i < steps; ++i) (void)integrator.step(state);
  }
  model::Integrator integrator;
  model::State state;
};

// Two patches whose border nodes coincide are the one sheet that they would be without the seam.
TEST(SewnCloth, ConformingPatchesMoveLikeOneSheet) {
  const auto sewn = sewn_model({{0, 0, 1, 1, 9, 9}, {1, 0, 2, 1, 9, 9}});
  ASSERT_EQ(sewn.sewing.map().num_slaves(), 9);
  const auto whole = testing::cloth_model(testing::patchwork({{0, 0, 2, 1, 17, 9}}),
                                          testing::cotton(std::nullopt));
  Motion a(sewn, {0, 89});
  Motion b(whole, {0, 16});
  double largest = 0;
  for (int round = 0; round < 60; ++round) {
    a.advance(1);
    b.advance(1);
    for (int j = 0; j < 9; ++j)
      for (int i = 0; i < 9; ++i) {
        largest = std::max(largest, (a.state.x.row(9 * j + i) - b.state.x.row(17 * j + i)).norm());
        largest = std::max(largest,
                           (a.state.x.row(81 + 9 * j + i) - b.state.x.row(17 * j + 8 + i)).norm());
      }
  }
  EXPECT_LT(largest, 1e-9);
  EXPECT_LT(b.state.x.col(1).minCoeff(), -0.2) << "it has fallen";
}

TEST(SewnCloth, SeamsHoldAndBitsDoNotDependOnThreads) {
  const auto model = sewn_model(testing::four_patches());
  const Eigen::MatrixXd C = testing::constraint_rows(
      testing::geometric_stitches(testing::four_patches()), model.num_vertices());
  ASSERT_GT(model.sewing.map().num_slaves(), 25);
  Positions expected;
  for (const int threads : {1, 2, 8}) {
    Motion motion(model, {0, 12});
    ThreadPool(threads).run([&] { motion.advance(20); });
    EXPECT_LT((C * motion.state.x).cwiseAbs().maxCoeff(), 1e-14) << "every stitch holds";
    if (expected.size() == 0) expected = motion.state.x;
    EXPECT_TRUE(motion.state.x == expected) << threads;
  }
  EXPECT_LT(expected.col(1).minCoeff(), -0.05);
}

TEST(SewnCloth, OpenSeamsCloseInTheirTime) {
  const std::vector<testing::Patch> patches = {{0, 0, 1, 1, 7, 7}, {1, 0, 2, 1, 7, 10}};
  const auto model = sewn_model(patches, /*close_time=*/0.25, {0.2, 0.05, 0});
  const Eigen::MatrixXd C =
      testing::constraint_rows(testing::geometric_stitches(patches), model.num_vertices());
  const auto gap = [&](const Positions& x) { return (C * x).rowwise().norm().maxCoeff(); };
  Motion motion(model, {0, 42}, std::nullopt);
  EXPECT_NEAR(gap(motion.state.x), std::hypot(0.2, 0.05), 1e-12);
  motion.advance(15);
  EXPECT_NEAR(gap(motion.state.x), std::hypot(0.2, 0.05) / 2, 1e-12);
  motion.advance(15);
  EXPECT_LT(gap(motion.state.x), 1e-14);
  motion.advance(10);
  EXPECT_LT(gap(motion.state.x), 1e-14);
}

// Seams are internal forces: without anything else they change no momentum.
TEST(SewnCloth, ClosingSeamsConserveMomentum) {
  const auto model = sewn_model({{0, 0, 1, 1, 7, 7}, {1, 0, 2, 1, 7, 10}}, 0.25, {0.2, 0.05, 0});
  Motion motion(model, {}, std::nullopt);
  motion.advance(40);
  EXPECT_GT(model::kinetic_energy(model, motion.state.v), 1e-4) << "it moves";
  EXPECT_LT(model::linear_momentum(model, motion.state.v).norm(), 1e-9);
}

TEST(SewnCloth, APinOnASlaveHoldsTheSeam) {
  const auto model = sewn_model({{0, 0, 1, 1, 3, 3}, {1, 0, 2, 1, 3, 5}});
  const auto pins =
      model::pins_on_carriers({{.vertices = {9, 12, 15, 18, 21}}}, model.sewing.map(),
                              {[](std::size_t) { return "pin"; }, [](int) { return "vertex"; }});
  Motion motion(model, pins[0].vertices);
  motion.advance(20);
  for (const int v : {2, 5, 8, 9, 12, 15, 18, 21})
    EXPECT_TRUE(motion.state.x.row(v) == model.start.row(v)) << v;
  EXPECT_LT(motion.state.x(23, 1), -0.01);
}

// One step of the patches with T-junctions, from a prediction that is off the minimum everywhere.
struct SewnStep {
  SewnStep() : fixed(static_cast<std::size_t>(model.num_vertices()), 0) {
    fixed[0] = fixed[12] = 1;
    z += testing::random_positions(model.num_vertices(), 0.005, 17);
    start = z;
    model.sewing.settle(0, model.mass, fixed, start);
    for (const int v : {0, 12}) z.row(v) = start.row(v) = model.start.row(v);
    model.sewing.follow(0, start);
  }
  /// Where a method ends, with a gradient of at most 1e-9.
  [[nodiscard]] Positions end(model::Minimizer& method) const {
    Positions x = start;
    const auto report = method.minimize({&z, &fixed, &model.start}, x);
    EXPECT_TRUE(report.converged) << report.gradient;
    return x;
  }
  model::ClothModel model = sewn_model(testing::four_patches());
  Positions z = model.start;
  Positions start;
  std::vector<char> fixed;
};

constexpr model::StopOptions kTight{model::StopRule::Gradient, 1e-9, 20000, 1};

TEST(SewnCloth, NewtonFindsTheMinimumOfProjectiveDynamics) {
  const SewnStep step;
  VanillaPd pd(step.model, kH, 9.81, kTight);
  const Positions expected = step.end(pd);
  ASSERT_GT((expected - step.start).cwiseAbs().maxCoeff(), 1e-3) << "it moves";
  for (const auto linear : {NewtonLinear::Cholmod, NewtonLinear::Pcg})
    for (const auto hessian : {model::HessianForm::Projected, model::HessianForm::Unprojected}) {
      Newton newton(step.model, kH, 9.81, kTight, {hessian, linear});
      EXPECT_LT((step.end(newton) - expected).cwiseAbs().maxCoeff(), 1e-7);
    }
}

TEST(SewnCloth, PdJacobiFindsTheMinimumOfProjectiveDynamics) {
  const SewnStep step;
  VanillaPd pd(step.model, kH, 9.81, kTight);
  PdJacobi jacobi(step.model, kH, 9.81, {model::StopRule::Gradient, 1e-9, 200000, 1});
  EXPECT_LT((step.end(jacobi) - step.end(pd)).cwiseAbs().maxCoeff(), 1e-7);
}

TEST(SewnCloth, XpbdKeepsTheSeams) {
  const auto model = sewn_model({{0, 0, 1, 1, 7, 7}, {1, 0, 2, 1, 7, 10}}, 0.25, {0.2, 0.05, 0});
  const Eigen::MatrixXd C = testing::constraint_rows(
      testing::geometric_stitches({{0, 0, 1, 1, 7, 7}, {1, 0, 2, 1, 7, 10}}), model.num_vertices());
  model::Integrator integrator(
      model, Motion::forces(std::nullopt), {{.vertices = {0, 42}}}, {.h = kH},
      std::make_unique<Xpbd>(model, kH, 9.81,
                             model::StopOptions{model::StopRule::Iterations, 0, 50}));
  model::State state = integrator.initial_state({});
  for (int i = 0; i < 40; ++i) (void)integrator.step(state);
  EXPECT_LT((C * state.x).cwiseAbs().maxCoeff(), 1e-13) << "closed, and every stitch holds";
  EXPECT_TRUE(state.x.row(0) == model.start.row(0));
  const auto strain = model::triangle_strain(model, state.x);
  EXPECT_LT(*std::max_element(strain.begin(), strain.end()), 0.5);
}

}  // namespace
}  // namespace piecework::baselines
