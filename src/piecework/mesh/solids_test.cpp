#include <piecework/mesh/solids.hpp>

#include <gtest/gtest.h>

#include <numbers>

#include <piecework/mesh/import.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::mesh {
namespace {

constexpr double kPi = std::numbers::pi;

double volume(const TriangleMesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.positions.row(t[0]), b = mesh.positions.row(t[1]),
               c = mesh.positions.row(t[2]);
    sum += a.dot(b.cross(c)) / 6;
  }
  return sum;
}

/// Closed, clean and facing outward; returns the number of pieces.
int expect_solid(const TriangleMesh& mesh) {
  EXPECT_NO_THROW(validate(mesh, "solid"));
  const std::vector<Edge> edges = find_edges(mesh.triangles);
  EXPECT_TRUE(border_vertices(edges).empty());
  EXPECT_GT(volume(mesh), 0);
  std::vector<int> component;
  return edge_components(mesh.triangles, edges, component);
}

TEST(Solids, IcosphereHasTheVolumeAndCountsOfASphere) {
  for (const int parts : {1, 2, 3, 10}) {
    const TriangleMesh ball = icosphere(2, parts);
    EXPECT_EQ(expect_solid(ball), 1);
    EXPECT_EQ(ball.num_vertices(), 10 * parts * parts + 2);
    EXPECT_EQ(ball.num_triangles(), 20 * parts * parts);
    for (Eigen::Index v = 0; v < ball.positions.rows(); ++v)
      EXPECT_NEAR(ball.positions.row(v).norm(), 2, 1e-14);
  }
  EXPECT_NEAR(volume(icosphere(2, 40)), 32 * kPi / 3, 0.05);
}

TEST(Solids, BoxesSharpAndRounded) {
  EXPECT_EQ(box(Vec3(1, 2, 3)).num_vertices(), 8);
  EXPECT_NEAR(volume(box(Vec3(1, 2, 3))), 6, 1e-14);
  for (const double rounding : {0.0, 0.2, 0.5})
    EXPECT_EQ(expect_solid(box(Vec3(1, 2, 3), rounding, 8)), 1);
  // Steiner's formula for a core of a x b x c grown by r.
  const double r = 0.25, a = 0.5, b = 1.5, c = 2.5;
  const double expected = a * b * c + 2 * r * (a * b + b * c + c * a) + kPi * r * r * (a + b + c) +
                          4 * kPi / 3 * r * r * r;
  EXPECT_NEAR(volume(box(Vec3(1, 2, 3), r, 24)), expected, 2e-3);
  EXPECT_NEAR(volume(box(Vec3(1, 1, 1), 0.5, 24)), kPi / 6, 1e-3) << "a ball";
}

TEST(Solids, LatheClosesAtPolesOrAsARing) {
  const std::vector<Vec2> cone{{0, 0}, {1, 0}, {0, 3}};
  EXPECT_EQ(expect_solid(lathe(cone, 200)), 1);
  EXPECT_NEAR(volume(lathe(cone, 200)), kPi, 2e-3);
  const std::vector<Vec2> square{{2, 0}, {3, 0}, {3, 1}, {2, 1}};
  EXPECT_EQ(expect_solid(lathe(square, 200)), 1);
  EXPECT_NEAR(volume(lathe(square, 200)), 5 * kPi, 1e-2);
}

TEST(Solids, SweptTubesDoNotTwist) {
  std::vector<Vec3> path;
  for (int i = 0; i <= 60; ++i) {
    const double angle = kPi * i / 60;
    path.emplace_back(std::cos(angle), std::sin(angle), 0);
  }
  const std::vector<double> radii(path.size(), 0.2);
  const TriangleMesh tube = sweep(path, radii, 24);
  EXPECT_EQ(expect_solid(tube), 1);
  // Pappus: area times the way of the centre.
  EXPECT_NEAR(volume(tube), kPi * 0.04 * kPi, 0.01);
  // In a plane the frame keeps its height above the plane, all along.
  for (int i = 0; i < 24; ++i)
    EXPECT_NEAR(tube.positions(1 + i, 2), tube.positions(1 + 60 * 24 + i, 2), 1e-12);
  const std::vector<Vec3> straight{{0, 0, 0}, {0, 1, 0}, {0, 2, 0}};
  EXPECT_EQ(expect_solid(sweep(straight, std::vector<double>(3, 0.1), 3)), 1);
}

TEST(Solids, StairsHaveTheVolumeOfTheirSteps) {
  for (const int steps : {1, 2, 7}) {
    const TriangleMesh flight = stairs(Vec3(2, 1.4, 3), steps);
    EXPECT_EQ(expect_solid(flight), 1);
    const double tread = 3.0 / steps, rise = 1.4 / steps;
    EXPECT_NEAR(volume(flight), 2 * tread * rise * steps * (steps + 1) / 2, 1e-12);
    EXPECT_TRUE(flight.positions.colwise().minCoeff().isApprox(Eigen::RowVector3d(-1, 0, 0)));
    EXPECT_TRUE(flight.positions.colwise().maxCoeff().isApprox(Eigen::RowVector3d(1, 1.4, 3)));
  }
}

TEST(Solids, FunnelAndPotAreCleanAndStandOnTheGround) {
  for (const int columns : {12, 60}) {
    const TriangleMesh cone = funnel(0.5, 0.8, columns);
    EXPECT_EQ(expect_solid(cone), 1);
    EXPECT_NEAR(cone.positions.col(1).minCoeff(), 0, 1e-14);
    EXPECT_NEAR(cone.positions.col(1).maxCoeff(), 0.8, 1e-3);
    EXPECT_NEAR(cone.positions.col(0).maxCoeff(), 0.5, 1e-3);
    const TriangleMesh kettle = pot(0.5, columns);
    EXPECT_EQ(expect_solid(kettle), 4);
    EXPECT_NEAR(kettle.positions.col(1).minCoeff(), 0, 1e-14);
    EXPECT_NEAR(kettle.positions.col(1).maxCoeff(), 0.85, 1e-3);
    EXPECT_GT(kettle.positions.col(0).maxCoeff(), 0.75) << "the spout";
  }
}

}  // namespace
}  // namespace piecework::mesh
