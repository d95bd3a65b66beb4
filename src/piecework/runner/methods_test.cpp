// Methods that share nothing but the scene, against each other: one minimum, whichever way.

#include <limits>
#include <optional>

#include <gtest/gtest.h>

#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/pd/dd_pd.hpp>
#include <piecework/runner/methods.hpp>
#include <piecework/testing/jolted_cloth.hpp>
#include <piecework/testing/patchwork.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

using model::StopRule;
using testing::JoltedCloth;

const model::StopOptions kTight{StopRule::Gradient, 1e-9, 20000, 1};

pd::DdPd engine(const JoltedCloth& cloth, model::StopOptions stop, pd::AccelerationKind kind,
                pd::NormalPart normals, global::Precision precision) {
  return pd::DdPd(cloth.model,
                  {.h = JoltedCloth::kH,
                   .gravity = JoltedCloth::kGravity,
                   .stop = stop,
                   .acceleration = {.kind = kind},
                   .normals = normals},
                  global::make_tree_solver({}, {.precision = precision}));
}

TEST(Methods, DdPdWithoutAccelerationIsVanillaProjectiveDynamics) {
  const JoltedCloth cloth(testing::grid_mesh(10, 10), testing::cotton(1e-3), 0.01);
  const model::StopOptions stop{StopRule::Iterations, 0, 12, 1};
  baselines::VanillaPd vanilla(cloth.model, JoltedCloth::kH, JoltedCloth::kGravity, stop);
  pd::DdPd ours = engine(cloth, stop, pd::AccelerationKind::None, pd::NormalPart::Never,
                         global::Precision::Double);
  Positions expected;
  Positions x;
  const auto reference = cloth.solve(vanilla, expected);
  const auto report = cloth.solve(ours, x);
  EXPECT_LT((x - expected).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(report.gradient, reference.gradient, 1e-9 * reference.gradient);
  EXPECT_NEAR(report.dx_2, reference.dx_2, 1e-9 * reference.dx_2);
}

TEST(Methods, SewnClothReachesTheSameMinimum) {
  JoltedCloth cloth(testing::patchwork(testing::four_patches()), testing::cotton(std::nullopt),
                    0.005);
  const auto stitches = testing::geometric_stitches(testing::four_patches());
  cloth.model.sewing = model::Sewing(
      mesh::resolve_seams(stitches, cloth.model.num_vertices(), testing::plain_names()),
      cloth.model.start);
  cloth.model.sewing.mark_held(cloth.fixed);
  cloth.model.sewing.settle(1.0, cloth.model.mass, cloth.fixed, cloth.z);
  baselines::VanillaPd vanilla(cloth.model, JoltedCloth::kH, JoltedCloth::kGravity, kTight);
  pd::DdPd ours = engine(cloth, kTight, pd::AccelerationKind::Lbfgs, pd::NormalPart::Always,
                         global::Precision::Single);
  Positions expected;
  Positions x;
  const auto reference = cloth.solve(vanilla, expected);
  const auto report = cloth.solve(ours, x);
  ASSERT_TRUE(reference.converged);
  ASSERT_TRUE(report.converged);
  EXPECT_LT(5 * report.iterations, reference.iterations);
  EXPECT_LT((x - expected).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT(cloth.model.sewing.gap(x), 1e-12);
}

/// The corrected sweep keeps the minimum and the monotone way; the printed one has neither.
TEST(Methods, SweepsKeepTheMinimumUnlessTakenLiterally) {
  const JoltedCloth cloth(testing::grid_mesh(12, 12), testing::cotton(1e-3), 0.01);
  const auto domains =
      decomposition::decompose({cloth.model.triangles, cloth.model.hinges, cloth.model.hinge_bends,
                                cloth.model.num_vertices()},
                               {.domains = 4});
  const auto solve = [&](std::optional<local::SweepForm> form, pd::AccelerationKind kind,
                         model::StopOptions stop, Positions& x) {
    pd::DdPdOptions options{.h = JoltedCloth::kH,
                            .gravity = JoltedCloth::kGravity,
                            .stop = stop,
                            .acceleration = {.kind = kind},
                            .normals = pd::NormalPart::Never};
    if (form) options.sweeps = local::SweepOptions{.form = *form};
    pd::DdPd solver(cloth.model, options, global::make_tree_solver({}, {}), &domains);
    model::StepProblem problem = cloth.problem();
    double last = std::numeric_limits<double>::infinity();
    problem.observer = [&](const model::StepReport& report, const Positions&) {
      if (form != local::SweepForm::LiteralEq12) {
        EXPECT_LE(report.energy, last * (1 + 1e-12)) << report.iterations;
      }
      last = report.energy;
      return true;
    };
    x = cloth.z;
    return solver.minimize(problem, x);
  };
  using enum pd::AccelerationKind;
  using enum local::SweepForm;
  const model::StopOptions tight{StopRule::Gradient, 1e-7, 20000, 1};
  Positions exact;
  const auto plain = solve(std::nullopt, None, tight, exact);
  ASSERT_TRUE(plain.converged);
  for (const auto kind : {None, Anderson, Lbfgs}) {
    Positions x;
    const auto swept = solve(Corrected, kind, tight, x);
    EXPECT_TRUE(swept.converged);
    EXPECT_LT(swept.iterations, 0.75 * plain.iterations);
    EXPECT_LT((x - exact).cwiseAbs().maxCoeff(), 1e-6);
  }
  Positions biased;
  (void)solve(LiteralEq12, None, {StopRule::Iterations, 0, 300, 1}, biased);
  EXPECT_TRUE(biased.allFinite());
  EXPECT_GT((biased - exact).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(Methods, AreMadeAsTheSceneNamesThem) {
  const auto method = [](const std::vector<scene::Override>& overrides) {
    const auto world = build_world(small_scene(overrides));
    const auto integrator = make_integrator(*world);
    model::State state = integrator->initial_state(world->part_velocity);
    EXPECT_EQ(integrator->step(state).iterations, 6);
    return integrator->minimizer().description();
  };
  EXPECT_TRUE(
      method({}).starts_with("DD-PD, L-BFGS of 5 pairs in the metric K + N, tree, 32-bit factor"));
  EXPECT_TRUE(
      method({{"solver.local", "gauss_seidel"}}).starts_with("DD-PD, Gauss-Seidel sweeps, L-BFGS"));
  EXPECT_TRUE(method({{"solver.local", "literal_eq12"}, {"quality.accelerate", "none"}})
                  .starts_with("DD-PD, Eq. 12 as printed (biased), not accelerated, tree"));
  EXPECT_TRUE(method({{"solver.method", "vanilla_pd"}}).starts_with("vanilla PD"));
  EXPECT_TRUE(method({{"solver.method", "newton"}}).starts_with("projected Newton, CHOLMOD"));
  EXPECT_TRUE(method({{"solver.method", "newton"},
                      {"solver.hessian", "unprojected"},
                      {"solver.linear", "pcg"}})
                  .starts_with("unprojected Newton, PCG"));
  EXPECT_TRUE(method({{"solver.method", "pd_jacobi"}, {"solver.chebyshev_rho", "0.75"}})
                  .ends_with("rho = 0.75"));
  EXPECT_TRUE(method({{"solver.method", "xpbd"}}).starts_with("XPBD"));
}

}  // namespace
}  // namespace piecework::runner
