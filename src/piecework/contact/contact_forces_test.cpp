// Forces of contact and friction against the energy that they are said to be the gradient of.

#include <cmath>

#include <gtest/gtest.h>

#include "contact_test_util.hpp"

namespace piecework::contact {
namespace {

using collision::PairKind;

/// Two sheets of 4 x 4 vertices over 1 m x 1 m, bent at random so that much of them is near.
struct Crumpled : ContactStep {
  Positions x;

  explicit Crumpled(Barrier barrier, std::optional<colliders::Friction> friction = std::nullopt,
                    double offset = 0.06)
      : ContactStep(stacked_sheets(2, 4, 0.1)) {
    options.activation = {barrier, 0.15, 40};
    options.friction = friction;
    options.slip_speed = 1;
    previous += testing::random_positions(model.num_vertices(), 0.3 * offset, 3);
    begin();
    if (friction) {
      (void)energy(previous);
      (void)contact->renew_friction();
    }
    Positions still = previous;
    (void)contact->start(still);
    x = previous + testing::random_positions(model.num_vertices(), 0.5 * offset, 4);
  }

  void expect_gradient() const {
    const Positions g = gradient(x);
    const double scale = g.cwiseAbs().maxCoeff();
    ASSERT_GT(scale, 1e-3) << "nothing touches, nothing was tested";
    for (Eigen::Index v = 0; v < x.rows(); ++v)
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(g(v, axis), slope_of_energy(*this, x, v, axis, 1e-7), 2e-6 * scale)
            << "vertex " << v << " axis " << axis;
  }
};

constexpr colliders::Friction kRubs{0.7};

class EveryBarrierForce : public ::testing::TestWithParam<Barrier> {};

TEST_P(EveryBarrierForce, IsTheGradientOfTheEnergy) { Crumpled(GetParam()).expect_gradient(); }

TEST_P(EveryBarrierForce, WithFrictionToo) { Crumpled(GetParam(), kRubs).expect_gradient(); }

TEST_P(EveryBarrierForce, WithLessFrictionOfWhatSlidesToo) {
  const Crumpled step(GetParam(), colliders::Friction{0.7, 0.2}), as_much(GetParam(), kRubs);
  step.expect_gradient();
  EXPECT_LT(step.energy(step.x), as_much.energy(as_much.x)) << "something slides";
}

INSTANTIATE_TEST_SUITE_P(All, EveryBarrierForce,
                         ::testing::Values(Barrier::None, Barrier::TwoStage, Barrier::Ipc,
                                           Barrier::Exponential));

/// How much of its energy an edge pair keeps: 1 unless nearly parallel.
double fade(const ActivePair& pair, const Positions& x, const Activation& activation) {
  Vec3 offset = Vec3::Zero();
  for (std::size_t k = 0; k < 4; ++k) offset += pair.beta[k] * x.row(pair.vertices[k]).transpose();
  return pair.energy / activation(offset.norm()).energy;
}

TEST(ContactForces, NearlyParallelEdgesFadeWithTheirGradient) {
  const Crumpled step(Barrier::TwoStage, std::nullopt, 0.01);
  step.expect_gradient();
  int fading = 0;
  (void)step.gradient(step.x);
  for (const ActivePair& pair : step.contact->active()) {
    const double part = fade(pair, step.x, step.options.activation);
    EXPECT_LE(part, 1 + 1e-12);
    if (part > 0.01 && part < 0.99) ++fading;
  }
  EXPECT_GT(fading, 5);
}

TEST(ContactForces, ParallelEdgesExertNothing) {
  ContactStep step(stacked_sheets(2, 3, 0.1));
  step.options.activation = {Barrier::TwoStage, 0.15, 40};
  step.begin();
  const Positions g = step.gradient(step.previous);
  int parallel = 0;
  for (const ActivePair& pair : step.contact->active())
    if (fade(pair, step.previous, step.options.activation) == 0) ++parallel;
  EXPECT_GE(parallel, 12) << "each border edge lies above its own kind";
  EXPECT_TRUE(g.allFinite());
  EXPECT_LT(g.col(1).tail(9).maxCoeff(), 0) << "vertices do the work";
}

TEST(ContactForces, OfClothOnItselfHaveNoSumAndNoMoment) {
  const Crumpled step(Barrier::TwoStage);
  const Positions g = step.gradient(step.x);
  Vec3 sum = Vec3::Zero(), moment = Vec3::Zero();
  for (Eigen::Index v = 0; v < g.rows(); ++v) {
    sum += g.row(v).transpose();
    moment += step.x.row(v).transpose().cross(Vec3(g.row(v).transpose()));
  }
  const double scale = g.cwiseAbs().sum();
  ASSERT_GT(scale, 1);
  EXPECT_LT(sum.norm(), 1e-14 * scale);
  EXPECT_LT(moment.norm(), 1e-13 * scale);
}

TEST(ContactForces, FrictionHasNoSumAndOpposesTheSlip) {
  const Crumpled with(Barrier::TwoStage, kRubs), without(Barrier::TwoStage);
  ASSERT_TRUE(with.x == without.x);
  const Positions friction = with.gradient(with.x) - without.gradient(without.x);
  const double scale = friction.cwiseAbs().sum();
  ASSERT_GT(scale, 0.1);
  EXPECT_LT(friction.colwise().sum().norm(), 1e-13 * scale);
  const Positions way = with.x - with.previous;
  EXPECT_GT(friction.cwiseProduct(way).sum(), 0) << "the gradient grows along the way";
  EXPECT_NEAR(with.gradient(with.previous).cwiseAbs().sum(),
              without.gradient(without.previous).cwiseAbs().sum(), 1e-9)
      << "nothing has slid yet";
}

TEST(ContactForces, HeldVerticesFeelNothing) {
  ContactStep step(stacked_sheets(2, 4, 0.1));
  step.options.activation = {Barrier::TwoStage, 0.15, 40};
  for (std::size_t v = 0; v < 16; ++v) step.fixed[v] = 1;
  step.begin();
  const Positions g = step.gradient(step.previous);
  EXPECT_EQ(g.topRows(16).cwiseAbs().maxCoeff(), 0);
  EXPECT_LT(g.col(1).bottomRows(16).maxCoeff(), 0);
}

TEST(ContactForces, OfBodiesAndMeshesAreTheGradientToo) {
  ContactStep step(testing::grid_mesh(5, 5));
  step.previous.col(1).array() += 0.05;
  step.previous += testing::random_positions(25, 0.04, 5);
  const auto here = Eigen::Isometry3d::Identity();
  step.bodies.emplace_back(colliders::Traits{"ball", colliders::Friction{0.3}, 0.2},
                           colliders::Sphere{Vec3(0.6, -1, 0.5), 1}, here,
                           colliders::RigidMotion{});
  mesh::TriangleMesh floor = testing::grid_mesh(3, 3, 1.2);
  step.meshes.emplace_back(colliders::Traits{"floor", colliders::Friction{0.5}, std::nullopt},
                           floor, Eigen::Affine3d::Identity(), colliders::RigidMotion{});
  step.options.activation = {Barrier::TwoStage, 0.12, 40};
  step.options.friction = colliders::Friction{0.4};
  step.options.slip_speed = 1;
  step.begin();
  (void)step.energy(step.previous);
  ASSERT_TRUE(step.contact->renew_friction());
  const Positions x = step.previous + testing::random_positions(25, 0.01, 6);
  const Positions g = step.gradient(x);
  int of_body = 0, of_mesh = 0;
  for (const ActivePair& pair : step.contact->active()) {
    ++(pair.count == 1 ? of_body : of_mesh);
    EXPECT_EQ(pair.friction.sticking, pair.count == 1 ? 0.3 : 0.5) << "the collider's own";
  }
  EXPECT_GT(of_body, 5);
  EXPECT_GT(of_mesh, 20);
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(g(v, axis), slope_of_energy(step, x, v, axis, 1e-7),
                  2e-6 * g.cwiseAbs().maxCoeff());
}

TEST(ContactForces, BlocksOfTheHessianAreThoseOfTheForces) {
  // One vertex above a body: nothing fades, nothing turns, so H is exact along the normal.
  ContactStep step(testing::grid_mesh(2, 2, 1));
  step.bodies.emplace_back(colliders::Traits{"floor", {}, {}},
                           colliders::Plane{Vec3(0, -0.06, 0), Vec3::UnitY()},
                           Eigen::Isometry3d::Identity(), colliders::RigidMotion{});
  step.options.activation = {Barrier::Ipc, 0.1, 40};
  step.begin();
  const double e = 1e-6;
  Positions above = step.previous, below = step.previous;
  above.col(1).array() += e;
  below.col(1).array() -= e;
  const Positions slope = (step.gradient(above) - step.gradient(below)) / (2 * e);
  (void)step.gradient(step.previous);
  std::vector<model::ContactBlock> blocks;
  step.contact->hessian(blocks);
  ASSERT_EQ(blocks.size(), 4U);
  for (const auto& block : blocks) {
    EXPECT_EQ(block.count, 1);
    EXPECT_NEAR(block.stiffness(1, 1), slope(block.vertices[0], 1), 1e-5 * block.stiffness(1, 1));
    EXPECT_EQ(block.stiffness(0, 0), 0);
  }
}

}  // namespace
}  // namespace piecework::contact
