// Single vertices and bodies with a closed form: no way leads in.

#include <piecework/contact/bodies.hpp>

#include <limits>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::contact {
namespace {

using colliders::AnalyticCollider;

const Activation kActivation{Barrier::TwoStage, 1e-3, 10};

AnalyticCollider body(colliders::Shape shape, colliders::RigidMotion motion = {}) {
  return {{"body", std::nullopt, std::nullopt},
          std::move(shape),
          Eigen::Isometry3d::Identity(),
          motion};
}

std::vector<AnalyticCollider> every_shape() {
  std::vector<AnalyticCollider> all;
  all.push_back(body(colliders::Plane{Vec3(0, 0.1, 0), Vec3(0.2, 1, 0)}));
  all.push_back(body(colliders::Sphere{Vec3(0.1, 0, 0), 0.4}));
  all.push_back(body(colliders::Capsule{Vec3(-0.3, 0, 0), Vec3(0.3, 0.1, 0), 0.2}));
  all.push_back(body(colliders::Box{Vec3(0, 0, 0.1), Vec3(0.5, 0.002, 0.4), 0}));
  all.push_back(body(colliders::Box{Vec3::Zero(), Vec3(0.3, 0.2, 0.4), 0.05}));
  all.push_back(body(colliders::Cylinder{Vec3(0, -0.2, 0), Vec3(0, 0.3, 0), 0.3, 0.02}));
  all.push_back(body(colliders::HalfSpaces(
      {{Vec3(0, 0.1, 0), Vec3(0, 1, 0)}, {Vec3(0.2, 0, 0), Vec3(1, 0.5, 0)}}, 0.01)));
  return all;
}

double distance(const AnalyticCollider& collider, const Positions& x, Eigen::Index v) {
  return collider.signed_distance(x.row(v).transpose(), 0.0).distance;
}

/// Least distance on the straight way, by looking often.
double least_on_way(const AnalyticCollider& collider, const Vec3& from, const Vec3& to) {
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k <= 2000; ++k)
    least =
        std::min(least, collider.signed_distance(from + k / 2000.0 * (to - from), 0.0).distance);
  return least;
}

class EveryShape : public ::testing::TestWithParam<int> {
 protected:
  std::vector<AnalyticCollider> one{every_shape()[static_cast<std::size_t>(GetParam())]};
  Bodies bodies{one, kActivation, std::nullopt};
};

TEST_P(EveryShape, LimitedWaysNeverLeadIn) {
  constexpr int kCount = 400;
  const std::vector<char> held(kCount, 0);
  bodies.begin_step(0, 0);
  Positions x = testing::random_positions(kCount, 1, 1);
  std::vector<char> outside(kCount);
  for (Eigen::Index v = 0; v < kCount; ++v)
    outside[static_cast<std::size_t>(v)] = distance(one[0], x, v) > 0;
  int cut = 0, near = 0;
  for (std::uint64_t round = 0; round < 60; ++round) {
    Positions to = x + testing::random_positions(kCount, round % 3 == 0 ? 3 : 0.3, 100 + round);
    // Half of them aim right at the body, again and again.
    for (Eigen::Index v = 0; v < kCount / 2; ++v) to.row(v) = 1e-3 * to.row(v);
    const Positions wanted = to;
    (void)bodies.limit(x, held, to);
    for (Eigen::Index v = 0; v < kCount; ++v) {
      if (!outside[static_cast<std::size_t>(v)]) continue;
      const double d = distance(one[0], to, v);
      EXPECT_GT(d, 0) << "vertex " << v << " round " << round;
      near += d < 1e-6;
      if (to.row(v) != wanted.row(v)) {
        ++cut;
        const Vec3 way = (wanted - x).row(v), part = (to - x).row(v);
        EXPECT_LT(way.normalized().cross(part).norm(), 1e-12) << "stays on its way";
      }
    }
    x = to;
  }
  EXPECT_GT(cut, 1000);
  EXPECT_GT(near, 100) << "as close as the barrier may let it come";
}

TEST_P(EveryShape, WhatMeetsNothingIsNotChanged) {
  constexpr int kCount = 1000;
  const std::vector<char> held(kCount, 0);
  bodies.begin_step(0, 0);
  const Positions x = testing::random_positions(kCount, 1, 3);
  const Positions wanted = x + testing::random_positions(kCount, 1, 4);
  Positions to = wanted;
  (void)bodies.limit(x, held, to);
  int free = 0;
  for (Eigen::Index v = 0; v < kCount; ++v) {
    const Vec3 from = x.row(v), end = wanted.row(v);
    if (!(distance(one[0], x, v) > 0) || least_on_way(one[0], from, end) < 1e-3) continue;
    EXPECT_TRUE(to.row(v) == wanted.row(v)) << v;
    ++free;
  }
  EXPECT_GT(free, 100);
}

// Cloth that lies on a body is far closer to it than it is wide.
TEST_P(EveryShape, WhatSlidesCloseAboveIsNotHeldUp) {
  bodies.begin_step(0, 0);
  Random random(7);
  int slid = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Vec3 p(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const auto at = one[0].signed_distance(p, 0.0);
    if (at.distance < 0.01) continue;
    Positions from = (p - (at.distance - 1e-5) * at.normal).transpose();
    const auto start = one[0].signed_distance(from.row(0).transpose(), 0.0);
    const Vec3 way = 0.3 * start.normal.unitOrthogonal();
    Positions to = from + way.transpose();
    const Positions wanted = to;
    (void)bodies.limit(from, {0}, to);
    EXPECT_TRUE(to == wanted) << trial;
    ++slid;
  }
  EXPECT_GT(slid, 50);
}

INSTANTIATE_TEST_SUITE_P(All, EveryShape, ::testing::Range(0, 7));

TEST(Bodies, ThinPlateStopsWhatIsFast) {
  std::vector<AnalyticCollider> plate{body(colliders::Box{Vec3::Zero(), Vec3(1, 0.5e-3, 1), 0})};
  Bodies bodies(plate, kActivation, std::nullopt);
  bodies.begin_step(0, 0);
  Positions from = Positions::Zero(100, 3), to;
  from.leftCols(3) = testing::random_positions(100, 0.5, 9);
  from.col(1).setConstant(0.01);
  to = from;
  to.col(1).array() -= 50.0 / 120;
  EXPECT_TRUE(bodies.limit(from, std::vector<char>(100, 0), to));
  EXPECT_GT(to.col(1).minCoeff(), 0.5e-3);
}

TEST(Bodies, HeldVerticesAndThoseInsideGoWhereTheyLike) {
  std::vector<AnalyticCollider> ball{body(colliders::Sphere{Vec3::Zero(), 0.5})};
  Bodies bodies(ball, kActivation, std::nullopt);
  bodies.begin_step(0, 0);
  Positions from(2, 3), to(2, 3);
  from << 1, 0, 0, 0.1, 0, 0;
  to << 0, 0, 0, 0, 0.2, 0;
  const Positions wanted = to;
  EXPECT_FALSE(bodies.limit(from, {1, 0}, to));
  EXPECT_TRUE(to == wanted);
  bodies.list(to, 1e-3);
  std::vector<ActivePair> active;
  bodies.activate(to, active);
  ASSERT_EQ(active.size(), 2U);
  for (const ActivePair& pair : active)
    EXPECT_LT(pair.gradient[0].dot(pair.normal), 0) << "outward";
}

TEST(Bodies, CarryWhatIsInTheirWay) {
  colliders::RigidMotion motion{.velocity = Vec3(0, 6, 0), .rate = 0};
  std::vector<AnalyticCollider> lift{body(colliders::Plane{}, motion)};
  Bodies bodies(lift, kActivation, std::nullopt);
  const double h = 0.01;
  bodies.begin_step(0, h);
  Positions previous(2, 3), x(2, 3);
  previous << 0, 1e-3, 0, 5, 1, 0;
  x = previous;
  bodies.move(1, previous, {0, 0}, x);
  EXPECT_GT(x(0, 1), 0.06);
  EXPECT_LT(x(0, 1), 0.061);
  EXPECT_EQ(x(1, 1), 1) << "it has not come that far";
  ActivePair pair;
  pair.vertices = {0, 0, -1, -1};
  const Vec3 unslid = bodies.unslid(pair, Vec3(0.5, 1e-3, 0));
  EXPECT_NEAR((unslid - Vec3(0.5, 0.061, 0)).norm(), 0, 1e-15);
}

}  // namespace
}  // namespace piecework::contact
