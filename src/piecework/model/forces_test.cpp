#include <piecework/model/forces.hpp>

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include <piecework/model/pins.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::model {
namespace {

Positions accelerations(const ClothModel& model, const ExternalForces& forces, const Positions& v,
                        double time = 0, double h = 1e-6) {
  Positions a;
  ForceField(model, forces).evaluate(model.start, v, time, h, a);
  return a;
}

TEST(Forces, GravityIsTheSameForEveryVertex) {
  const auto model = testing::cloth_model(testing::grid_mesh(4, 4), testing::cotton());
  const Positions a = accelerations(model, {.gravity = Vec3(0, -9.81, 0)}, Positions::Zero(16, 3));
  for (Eigen::Index v = 0; v < 16; ++v) EXPECT_EQ(a.row(v), Eigen::RowVector3d(0, -9.81, 0));
}

// A flat plate across the wind: total force 1/2 rho A v^2 C_n.
TEST(Forces, WindOnAPlateHasTheAnalyticDrag) {
  const auto model = testing::cloth_model(testing::grid_mesh(5, 5, 2.0), testing::cotton());
  const Wind wind{
      .velocity = Vec3(0, 3, 0), .air_density = 1.2, .normal_drag = 1.3, .tangential_drag = 0};
  const Positions a = accelerations(model, {.wind = wind}, Positions::Zero(25, 3));
  const Vec3 total = a.transpose() * model.mass;
  EXPECT_NEAR(total.y(), 0.5 * 1.2 * 4.0 * 9.0 * 1.3, 1e-3);
  EXPECT_NEAR(total.x(), 0, 1e-12);
}

TEST(Forces, WindAlongThePlateHasTangentialDragOnly) {
  const auto model = testing::cloth_model(testing::grid_mesh(5, 5), testing::cotton());
  const Wind wind{
      .velocity = Vec3(2, 0, 0), .air_density = 1.2, .normal_drag = 1, .tangential_drag = 0.1};
  const Vec3 total =
      accelerations(model, {.wind = wind}, Positions::Zero(25, 3)).transpose() * model.mass;
  EXPECT_NEAR(total.x(), 0.5 * 1.2 * 1.0 * 4.0 * 0.1, 1e-4);
}

TEST(Forces, ClothThatMovesWithTheWindFeelsNothing) {
  const auto model = testing::cloth_model(testing::grid_mesh(4, 4), testing::cotton());
  const Wind wind{.velocity = Vec3(1, 2, 3)};
  const Positions v = Positions::Ones(16, 3) * Eigen::Vector3d(1, 2, 3).asDiagonal();
  EXPECT_EQ(accelerations(model, {.wind = wind}, v).norm(), 0);
}

// The limiter: even a storm on a feather in one long step cannot push it beyond the wind's speed.
TEST(Forces, WindNeverOvershoots) {
  Material feather = testing::cotton();
  feather.density = 1e-4;
  const auto model = testing::cloth_model(testing::grid_mesh(4, 4), feather);
  const double h = 0.2;
  const Positions a = accelerations(model, {.wind = Wind{.velocity = Vec3(0, 50, 0)}},
                                    Positions::Zero(16, 3), 0, h);
  EXPECT_LE((h * a).col(1).maxCoeff(), 50 * (1 + 1e-12));
  EXPECT_GT((h * a).col(1).maxCoeff(), 10);
}

TEST(Forces, GustsFollowTheSine) {
  const Wind wind{.velocity = Vec3(4, 0, 0), .gust_amplitude = 0.5, .gust_period = 2};
  EXPECT_NEAR(wind.at(0).x(), 4, 1e-14);
  EXPECT_NEAR(wind.at(0.5).x(), 6, 1e-14);
  EXPECT_NEAR(wind.at(1.5).x(), 2, 1e-14);
}

TEST(Forces, LoadIsSharedByMassAndTimed) {
  const auto model = testing::cloth_model(testing::grid_mesh(4, 4), testing::cotton());
  const ExternalForces forces{
      .loads = {{.vertices = {5, 6}, .force = Vec3(0, -2, 0), .start = 0.1, .stop = 0.2}}};
  const Positions still = Positions::Zero(16, 3);
  EXPECT_EQ(accelerations(model, forces, still, 0.05).norm(), 0);
  EXPECT_EQ(accelerations(model, forces, still, 0.2).norm(), 0);
  const Positions a = accelerations(model, forces, still, 0.15);
  EXPECT_NEAR((a.transpose() * model.mass).y(), -2, 1e-12);
  EXPECT_NEAR(a(5, 1), a(6, 1), 1e-12);
  EXPECT_EQ(a(0, 1), 0);
}

TEST(Pins, MoveTurnAndLetGo) {
  const Positions start = testing::grid_mesh(3, 3).positions;
  const double pi = std::numbers::pi;
  PinScript script({{.vertices = {0}},
                    {.vertices = {2}, .velocity = Vec3(0, 1, 0), .start = 1, .stop = 3},
                    {.vertices = {8},
                     .axis = Vec3(0, 2, 0),
                     .center = Vec3(0, 0, 1),
                     .rate = pi,
                     .release = 0.75}},
                   start);
  EXPECT_EQ(script.fixed_at(0), (std::vector<char>{1, 0, 1, 0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(script.fixed_at(0.75)[8], 0);
  Positions x = Positions::Zero(9, 3);
  script.place(0.5, x);
  EXPECT_TRUE(x.row(0) == start.row(0)) << "a still pin keeps its bits";
  EXPECT_TRUE(x.row(2) == start.row(2)) << "not yet moving";
  // (1, 0, 1) a quarter turn about y through (0, 0, 1): (0, 0, 0).
  EXPECT_LT((x.row(8) - Eigen::RowVector3d(0, 0, 0)).norm(), 1e-14);
  script.place(10, x);
  EXPECT_NEAR(x(2, 1), 2.0, 1e-14) << "stopped after two seconds";
  EXPECT_TRUE(x.row(4).isZero()) << "free vertices are not written";
}

}  // namespace
}  // namespace piecework::model
