// No limited move makes anything pass through anything: exact intersections are the judge.

#include <cmath>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>
#include <piecework/testing/patchwork.hpp>

#include "contact_test_util.hpp"

namespace piecework::contact {
namespace {

/// Random targets around x: most small, some as large as several sheets.
Positions random_target(const Positions& x, std::uint64_t seed) {
  constexpr std::array kSizes{0.02, 0.1, 0.4, 4.0};
  Positions way = testing::random_positions(static_cast<int>(x.rows()), kSizes[seed % 4], seed);
  if (seed % 7 == 0)  // a part of it only, and that in one piece
    for (Eigen::Index v = 0; v < x.rows(); ++v)
      way.row(v) = v < x.rows() / 2 ? Eigen::RowVector3d(0, 0.3, 0.1) : Eigen::RowVector3d::Zero();
  // Drawn together, or they would be thinned out.
  return (x + way) * (seed % 4 == 3 ? 0.05 : 0.97);
}

/// Steps of a start and three limited moves each; x is the last position.
void wander(ContactStep& step, int steps, Positions& x) {
  int shortened = 0;
  for (int k = 0; k < steps; ++k) {
    const auto seed = static_cast<std::uint64_t>(4 * k);
    x = step.go(random_target(step.previous, seed));
    ASSERT_EQ(step.intersections(x), 0U) << "start of step " << k;
    for (std::uint64_t move = 1; move < 4; ++move) {
      Positions to = random_target(x, seed + move);
      for (Eigen::Index v = 0; v < x.rows(); ++v)
        if (step.fixed[static_cast<std::size_t>(v)]) to.row(v) = x.row(v);
      step.model.sewing.follow(0, to);
      (void)step.contact->limit(x, to);
      ASSERT_EQ(step.intersections(to), 0U) << "move " << move << " of step " << k;
      x = to;
    }
    shortened += step.contact->report().shortened;
    step.previous = x;
  }
  EXPECT_GT(shortened, 2 * steps);
}

TEST(Moves, OfCrumpledSheetsNeverIntersect) {
  ContactStep step(stacked_sheets(2, 6, 0.05));
  Positions x;
  wander(step, 30, x);
  EXPECT_GT((x - step.model.start).cwiseAbs().maxCoeff(), 0.05);
}

TEST(Moves, OfThreeSheetsAndAMeshWithHeldVerticesNeverIntersect) {
  ContactStep step(stacked_sheets(3, 5, 0.05));
  mesh::TriangleMesh ball = testing::sphere_mesh(1, 0.3);
  ball.positions.col(1).array() -= 0.4;
  step.meshes.emplace_back(colliders::Traits{"ball", {}, {}}, ball, Eigen::Affine3d::Identity(),
                           colliders::RigidMotion{});
  Positions x;
  wander(step, 20, x);
  step.fixed[0] = step.fixed[30] = step.fixed[70] = 1;
  wander(step, 20, x);
}

TEST(Moves, OfSewnSheetsNeverIntersectAndStaySewn) {
  const auto patches = testing::four_patches();
  model::ClothModel model = testing::cloth_model(testing::patchwork(patches), testing::cotton());
  model.sewing = model::Sewing(mesh::resolve_seams(testing::geometric_stitches(patches),
                                                   model.num_vertices(), testing::plain_names()),
                               model.start);
  ContactStep step(std::move(model));
  step.previous.col(1) = 0.05 * (9 * step.previous.col(0)).array().sin();
  step.model.sewing.follow(0, step.previous);
  const auto target = [&](const Positions& x, std::uint64_t seed) {
    Positions to = random_target(x, seed);
    step.model.sewing.follow(0, to);
    return to;
  };
  const std::size_t at_start = step.intersections(step.previous);
  int shortened = 0;
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    const Positions x = step.go(target(step.previous, seed));
    EXPECT_LT(step.model.sewing.gap(x), 1e-12);
    EXPECT_LE(step.intersections(x), at_start) << seed << ": a seam may touch itself, no more";
    shortened += step.contact->report().shortened;
    step.previous = x;
  }
  EXPECT_GT(shortened, 15);
}

TEST(Moves, ThatHitNothingAreNotChanged) {
  ContactStep step(stacked_sheets(2, 6, 0.05));
  Positions wanted = step.previous + testing::random_positions(72, 0.02, 8);
  wanted.col(0).array() += 3;
  EXPECT_TRUE(step.go(wanted) == wanted);
  Positions to = wanted + testing::random_positions(72, 0.004, 9);
  const Positions same = to;
  EXPECT_FALSE(step.contact->limit(wanted, to));
  EXPECT_TRUE(to == same);
  EXPECT_EQ(step.contact->report().shortened, 0);
  EXPECT_EQ(step.contact->report().held_back, 0);
}

TEST(Moves, FastSheetsStopBeforeWhatIsThin) {
  constexpr double kWay = 50.0 / 120;
  mesh::TriangleMesh plate = testing::grid_mesh(5, 5, 3);
  plate.positions.rowwise() -= Eigen::RowVector3d(1, 0.2, 1);
  mesh::TriangleMesh lower = plate;
  lower.positions.col(1).array() -= 1e-3;
  const mesh::TriangleMesh both = testing::disjoint_union(plate, lower);
  for (const bool against_mesh : {true, false}) {
    ContactStep step(against_mesh ? testing::grid_mesh(6, 6)
                                  : testing::disjoint_union(testing::grid_mesh(6, 6), both));
    if (against_mesh)
      step.meshes.emplace_back(colliders::Traits{"plate", {}, {}}, both,
                               Eigen::Affine3d::Identity(), colliders::RigidMotion{});
    Positions wanted = step.previous;
    wanted.col(1).head(36).array() -= kWay;
    const Positions x = step.go(wanted);
    EXPECT_EQ(step.intersections(x), 0U);
    EXPECT_GT(x.col(1).head(36).minCoeff(), -0.2) << against_mesh;
    EXPECT_LT(x.col(1).head(36).minCoeff(), -0.1) << "it did go";
    EXPECT_GT(step.contact->report().shortened, 0);
  }
}

// Bounds of what can meet say "just not" here, or not, by rounding.
TEST(Moves, ThatWouldEndExactlyOnEachOtherAreCutShort) {
  for (const double height : {0.0497, 0.1, 0.31, 1.7}) {
    ContactStep step(stacked_sheets(2, 5, 0.004));
    Positions wanted = step.previous;
    wanted.col(1).setConstant(height);
    EXPECT_EQ(step.intersections(step.go(wanted)), 0U) << height;
  }
}

/// Held sheets below and above a free one close in on it, farther than to each other.
TEST(Moves, WhatIsHeldStopsAtWhatIsCaughtBetween) {
  ContactStep step(stacked_sheets(3, 5, 0.1));
  for (std::size_t v = 0; v < 75; ++v) step.fixed[v] = v < 25 || v >= 50;
  Positions wanted = step.previous;
  wanted.col(1).head(25).array() += 0.15;
  wanted.col(1).tail(25).array() -= 0.15;
  double part = 1;
  Positions x = step.go(wanted, 0, 0, &part);
  EXPECT_GT(part, 0);
  EXPECT_LT(part, 1);
  EXPECT_EQ(step.contact->report().held_back, 1 - part);
  for (int move = 0; move < 30; ++move) {
    EXPECT_EQ(step.intersections(x), 0U);
    for (Eigen::Index v = 0; v < 75; ++v) {
      if (!step.fixed[static_cast<std::size_t>(v)]) continue;
      const Eigen::RowVector3d way = (wanted - step.previous).row(v);
      const double done = (x - step.previous).row(v).dot(way) / way.squaredNorm();
      EXPECT_LT(((x - step.previous).row(v) - done * way).norm(), 1e-12) << "each on its way";
      EXPECT_GE(done, 0);
      EXPECT_LE(done, 1);
    }
    (void)step.contact->advance_held(x);
  }
  EXPECT_GT(step.contact->report().held_back, 0) << "they would have passed each other";
}

TEST(Moves, MovingMeshesPushAndAreHeldBackToo) {
  ContactStep step(stacked_sheets(2, 5, 0.1));
  for (std::size_t v = 25; v < 50; ++v) step.fixed[v] = 1;
  mesh::TriangleMesh lift = testing::grid_mesh(3, 3, 1.4);
  lift.positions.rowwise() -= Eigen::RowVector3d(0.2, 0.1, 0.2);
  step.meshes.emplace_back(colliders::Traits{"lift", {}, {}}, lift, Eigen::Affine3d::Identity(),
                           colliders::RigidMotion{.velocity = Vec3(0, 40, 0), .rate = 0});
  double part = 1;
  Positions x = step.go(step.previous, 0, 0.01, &part);
  EXPECT_LT(part, 0.5) << "the sheet above is held, that between caught";
  EXPECT_GT(step.contact->lagging_obstacles().rows(), 0);
  EXPECT_EQ(step.intersections(x), 0U);
  for (int move = 0; move < 10 && step.contact->advance_held(x); ++move)
    EXPECT_EQ(step.intersections(x), 0U);
  EXPECT_GT(step.contact->report().held_back, 0);
}

TEST(Moves, FrictionStartsFromWhereBodiesAreWhenTheStepBegins) {
  // A floor that sinks fast: at the step's begin it carries the sheet, at its end it is far away.
  ContactStep step(testing::grid_mesh(4, 4));
  step.options.activation = {Barrier::TwoStage, 0.01, 50};
  step.options.friction = colliders::Friction{0.5};
  step.bodies.emplace_back(
      colliders::Traits{"floor", {}, {}}, colliders::Plane{Vec3(0, -0.005, 0), Vec3::UnitY()},
      Eigen::Isometry3d::Identity(), colliders::RigidMotion{.velocity = Vec3(0, -5, 0), .rate = 0});
  step.begin(0, 0.01);
  EXPECT_EQ(step.contact->active().size(), 16U);
  Positions x = step.previous;
  (void)step.contact->start(x);
  (void)step.energy(x);
  EXPECT_FALSE(step.contact->touching());
}

}  // namespace
}  // namespace piecework::contact
