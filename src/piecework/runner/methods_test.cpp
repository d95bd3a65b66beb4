// Methods that share nothing but the scene, against each other: one minimum, whichever way.

#include <gtest/gtest.h>

#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/pd/dd_pd.hpp>
#include <piecework/testing/jolted_cloth.hpp>
#include <piecework/testing/patchwork.hpp>

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

}  // namespace
}  // namespace piecework::runner
