#include <piecework/colliders/motion.hpp>

#include <gtest/gtest.h>

#include <numbers>

#include <piecework/model/pins.hpp>

namespace piecework::colliders {
namespace {

TEST(RigidMotion, RestsUnlessToldToMove) {
  const RigidMotion rest;
  EXPECT_TRUE(rest.is_static());
  EXPECT_TRUE(rest.at(1e9).matrix() == Eigen::Matrix4d::Identity());
  RigidMotion turns;
  turns.rate = 1;
  turns.start = 2;
  EXPECT_FALSE(turns.is_static());
  EXPECT_TRUE(turns.at(2).matrix() == Eigen::Matrix4d::Identity()) << "to the last bit";
}

TEST(RigidMotion, AQuarterTurnThenAShift) {
  RigidMotion motion;
  motion.velocity = Vec3(0, 1, 0);
  motion.axis = Vec3(0, 5, 0);
  motion.center = Vec3(1, 0, 0);
  motion.rate = 0.5 * std::numbers::pi;
  motion.stop = 1.0;
  const Vec3 from(2, 0, 0);
  for (const double time : {1.0, 7.0})
    EXPECT_LT((motion.at(time) * from - Vec3(1, 1, -1)).norm(), 1e-15);
}

// Colliders and pins read the same keys: they must go the same way.
TEST(RigidMotion, MovesAsAPinDoes) {
  const model::Pin pin{.vertices = {0},
                       .velocity = Vec3(0.3, -1, 2),
                       .axis = Vec3(1, 2, -0.5),
                       .center = Vec3(0.2, 0, 3),
                       .rate = -4,
                       .start = 0.5,
                       .stop = 2};
  const RigidMotion motion{pin.velocity, pin.axis, pin.center, pin.rate, pin.start, pin.stop};
  Positions start(1, 3);
  start << 1, -2, 0.7;
  const model::PinScript script({pin}, start);
  for (const double time : {0.0, 0.5, 0.9, 2.0, 5.0}) {
    Positions x = start;
    script.place(time, x);
    EXPECT_LT((motion.at(time) * Vec3(start.row(0)) - Vec3(x.row(0))).norm(), 1e-14) << time;
  }
}

}  // namespace
}  // namespace piecework::colliders
