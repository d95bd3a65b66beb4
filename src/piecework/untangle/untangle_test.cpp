#include <piecework/untangle/untangle.hpp>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/mesh/solids.hpp>

#include "untangle_test_util.hpp"

namespace piecework::untangle {
namespace {

mesh::TriangleMesh moved(mesh::TriangleMesh mesh, const Vec3& by) {
  mesh.positions.rowwise() += by.transpose();
  return mesh;
}

/// In the xy plane.
mesh::TriangleMesh upright(int side, double size, const Vec3& corner) {
  mesh::TriangleMesh mesh = testing::grid_mesh(side, side, size);
  mesh.positions.col(1).swap(mesh.positions.col(2));
  return moved(mesh, corner);
}

mesh::TriangleMesh tube(double radius, int columns, int rows) {
  mesh::TriangleMesh mesh;
  mesh.positions.resize(columns * rows, 3);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const double angle = 2 * std::numbers::pi * i / columns;
      mesh.positions.row(j * columns + i) << radius * std::cos(angle), 0.05 * j,
          radius * std::sin(angle);
    }
  for (int j = 0; j + 1 < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const int a = j * columns + i, b = j * columns + (i + 1) % columns;
      mesh.triangles.push_back({a, a + columns, b});
      mesh.triangles.push_back({b, a + columns, b + columns});
    }
  return mesh;
}

mesh::TriangleMesh sheet() { return testing::grid_mesh(21, 21); }

TangledCloth two(const mesh::TriangleMesh& other) {
  return TangledCloth(testing::disjoint_union(sheet(), other));
}

TangledCloth wavy_sheet_in_flat_one() {
  mesh::TriangleMesh wavy = moved(sheet(), {0.003, 0.02, 0.007});
  for (Eigen::Index v = 0; v < wavy.positions.rows(); ++v)
    wavy.positions(v, 1) += 0.05 * std::sin(9 * wavy.positions(v, 0));
  return two(wavy);
}

/// Rolled up a little more than once around.
TangledCloth rolled_sheet() {
  TangledCloth cloth(sheet());
  for (Eigen::Index v = 0; v < cloth.x.rows(); ++v) {
    const double angle = 7 * (cloth.x(v, 0) - 0.5);
    cloth.x(v, 0) = std::sin(angle) / 7;
    cloth.x(v, 1) = (1 - std::cos(angle)) / 7;
  }
  return cloth;
}

TangledCloth poking_vertex(int vertex) {
  TangledCloth cloth = two(moved(sheet(), {0.003, -0.01, 0.007}));
  cloth.x(vertex, 1) = -0.05;
  return cloth;
}

TangledCloth over(const mesh::TriangleMesh& cloth, const mesh::TriangleMesh& body, const Vec3& at) {
  TangledCloth tangled(cloth);
  tangled.add(body, at);
  return tangled;
}

struct Case {
  const char* name;
  std::function<TangledCloth()> make;
  double longest;  ///< an edge afterwards, as part of its length before
};

class Tangles : public ::testing::TestWithParam<Case> {};

TEST_P(Tangles, AreTakenApart) {
  TangledCloth cloth = GetParam().make();
  const std::size_t before = cloth.intersections();
  ASSERT_GT(before, 0U);
  const Positions start = cloth.x;
  const UntangleReport report = cloth.untangle();
  EXPECT_EQ(cloth.intersections(), 0U);
  EXPECT_EQ(report.before.edges, static_cast<int>(before));
  EXPECT_EQ(report.after.total(), 0);
  EXPECT_FALSE(report.left_at);
  EXPECT_GT(report.rounds, 0);
  EXPECT_EQ(report.largest_move, (cloth.x - start).rowwise().norm().maxCoeff());
  EXPECT_LT(cloth.stretches()[1], GetParam().longest);
}

INSTANTIATE_TEST_SUITE_P(
    All, Tangles,
    ::testing::Values(Case{"SheetsAcross",
                           [] {
                             return two(upright(21, 1, {0.013, -0.487, 0.507}));
                           },
                           4},
                      Case{"NarrowSheetAcross",
                           [] {
                             return two(upright(11, 0.5, {0.213, -0.187, 0.507}));
                           },
                           2},
                      Case{"BordersAcross",
                           [] {
                             return two(upright(21, 1, {0.513, -0.487, 0.507}));
                           },
                           10},
                      Case{"WavySheet", wavy_sheet_in_flat_one, 8},
                      Case{"RolledSheet", rolled_sheet, 1.2},
                      Case{"OneVertex", [] { return poking_vertex(220); }, 2},
                      Case{"Corner", [] { return poking_vertex(0); }, 2},
                      Case{"CoplanarSheets",
                           [] {
                             return two(moved(sheet(), {0.31, 0, 0}));
                           },
                           1.1},
                      Case{"IdenticalSheets", [] { return two(sheet()); }, 1.1},
                      Case{"TubeThroughTube",
                           [] {
                             return TangledCloth(testing::disjoint_union(
                                 tube(0.3, 40, 20), moved(tube(0.32, 37, 20), {0.05, -0.013, 0})));
                           },
                           2},
                      Case{"CapOfSphere",
                           [] {
                             return over(sheet(), mesh::icosphere(0.3, 8), {0.5, -0.2, 0.5});
                           },
                           2},
                      Case{"BoxBelow",
                           [] {
                             return over(sheet(), mesh::box({0.5, 0.4, 0.5}), {0.5, -0.15, 0.5});
                           },
                           3},
                      Case{"OnBox",
                           [] {
                             return over(sheet(), mesh::box({0.5, 0.4, 0.5}), {0.5, -0.2, 0.5});
                           },
                           1.1},
                      Case{"BoxFromAside",
                           [] {
                             return over(testing::grid_mesh(21, 21, 0.5), mesh::box({1, 0.4, 1}),
                                         {-0.3, 0.05, 0.25});
                           },
                           8},
                      Case{
                          "TubeAroundSphere",
                          [] {
                            return over(tube(0.3, 40, 20), mesh::icosphere(0.33, 10), {0, 0.45, 0});
                          },
                          1.3}),
    [](const auto& tested) { return std::string(tested.param.name); });

TangledCloth sheet_in_ball() {
  TangledCloth cloth(sheet());
  cloth.bodies.push_back({{.name = "ball"},
                          colliders::Sphere{{0.5, -0.2, 0.5}, 0.3},
                          Eigen::Isometry3d::Identity(),
                          {}});
  return cloth;
}

int inside_ball(const TangledCloth& cloth, double radius) {
  return static_cast<int>(
      ((cloth.x.rowwise() - Eigen::RowVector3d(0.5, -0.2, 0.5)).rowwise().norm().array() < radius)
          .count());
}

TEST(Untangle, VerticesLeaveSolids) {
  TangledCloth cloth = sheet_in_ball();
  const int before = inside_ball(cloth, 0.3);
  ASSERT_GT(before, 20);
  const UntangleReport report = cloth.untangle();
  EXPECT_EQ(report.before.inside, before);
  EXPECT_EQ(report.after.inside, 0);
  EXPECT_EQ(inside_ball(cloth, 0.3 + 0.1 * cloth.options.distance), 0) << "with a gap";
  EXPECT_EQ(cloth.intersections(), 0U);
  EXPECT_LT(cloth.stretches()[1], 2);
}

TEST(Untangle, PinnedVerticesStayAndAreReported) {
  TangledCloth cloth = sheet_in_ball();
  constexpr int kMiddle = 220;
  ASSERT_GE(inside_ball(cloth, 0.3), 1);
  cloth.held[kMiddle] = 1;
  const Positions start = cloth.x;
  const UntangleReport report = cloth.untangle();
  EXPECT_TRUE(cloth.x.row(kMiddle) == start.row(kMiddle));
  EXPECT_EQ(inside_ball(cloth, 0.3), report.after.inside);
  EXPECT_GE(report.after.inside, 1);
  EXPECT_TRUE(report.left_at.has_value());
  EXPECT_TRUE(cloth.x.allFinite());
}

TEST(Untangle, WhereAllIsPinnedNothingMoves) {
  TangledCloth cloth = wavy_sheet_in_flat_one();
  std::fill(cloth.held.begin(), cloth.held.end(), char{1});
  const Positions start = cloth.x;
  const UntangleReport report = cloth.untangle();
  EXPECT_GT(report.before.edges, 0);
  EXPECT_EQ(report.after.edges, report.before.edges);
  EXPECT_TRUE(cloth.x == start);
}

TEST(Untangle, WhatIsApartStaysBitForBit) {
  TangledCloth cloth = over(sheet(), mesh::icosphere(0.3, 8), {0.5, 0, 0.5});
  cloth.x.col(1).array() += 0.31;
  ASSERT_EQ(cloth.intersections(), 0U);
  const Positions start = cloth.x;
  EXPECT_EQ(cloth.untangle().rounds, 0);
  EXPECT_TRUE(cloth.x == start);
}

TEST(Untangle, ClothThatLiesInAClosedMeshMayStay) {
  TangledCloth cloth = over(testing::grid_mesh(11, 11, 0.2), mesh::icosphere(0.5, 6), {0, 0, 0});
  const Positions start = cloth.x;
  EXPECT_EQ(cloth.untangle().before.total(), 0);
  EXPECT_TRUE(cloth.x == start);
}

TEST(Untangle, AMeshInsideOutIsLeftByItsOutsideToo) {
  mesh::TriangleMesh ball = mesh::icosphere(0.3, 8);
  for (Triangle& t : ball.triangles) std::swap(t[1], t[2]);
  TangledCloth cloth = over(sheet(), ball, {0.5, -0.2, 0.5});
  ASSERT_GT(cloth.intersections(), 0U);
  EXPECT_EQ(cloth.untangle().after.total(), 0);
  EXPECT_EQ(inside_ball(cloth, 0.29), 0);
}

TEST(Untangle, AnOpenMeshIsLeftByContours) {
  mesh::TriangleMesh bowl = mesh::icosphere(0.3, 8);
  std::erase_if(bowl.triangles, [&](const Triangle& t) {
    return bowl.positions(t[0], 1) < -0.1;  // no bottom
  });
  TangledCloth cloth = over(sheet(), bowl, {0.5, -0.27, 0.5});
  ASSERT_FALSE(cloth.meshes[0].closed());
  ASSERT_GT(cloth.intersections(), 0U);
  EXPECT_EQ(cloth.untangle().after.total(), 0);
  EXPECT_EQ(cloth.intersections(), 0U);
}

TEST(Untangle, TooFewRoundsKeepTheBestState) {
  TangledCloth cloth = wavy_sheet_in_flat_one();
  cloth.options.rounds = 5;
  const auto before = static_cast<int>(cloth.intersections());
  const UntangleReport report = cloth.untangle();
  EXPECT_EQ(report.rounds, 5);
  EXPECT_GT(report.after.edges, 0);
  EXPECT_LE(report.after.edges, before);
  EXPECT_EQ(static_cast<std::size_t>(report.after.edges), cloth.intersections());
  EXPECT_TRUE(report.left_at.has_value());
}

TEST(Untangle, DegenerateStartsEndWithFiniteNumbers) {
  const mesh::TriangleMesh small = testing::grid_mesh(6, 6);
  TangledCloth point(testing::disjoint_union(small, small)), line = point;
  point.x.setZero();
  line.x.rightCols<2>().setZero();
  for (TangledCloth* cloth : {&point, &line}) {
    cloth->options.rounds = 3;
    ASSERT_GT(cloth->intersections(), 0U);
    EXPECT_GT(cloth->untangle().after.edges, 0);
    EXPECT_TRUE(cloth->x.allFinite());
  }
}

TEST(Untangle, PositionsThatAreNotFiniteAreRefused) {
  TangledCloth cloth = two(sheet());
  cloth.x(5, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(cloth.untangle(), SimulationError);
}

TEST(Untangle, SameBitsForEveryThreadCount) {
  const auto untangled = [](int threads) {
    ThreadPool pool(threads);
    return pool.run([] {
      TangledCloth cloth = two(moved(sheet(), {0.003, -0.01, 0.007}));
      cloth.x(220, 1) = -0.05;
      cloth.add(mesh::icosphere(0.3, 8), {0.5, -0.28, 0.5});
      EXPECT_GT(cloth.intersections(), 0U);
      EXPECT_EQ(cloth.untangle().after.total(), 0);
      return cloth.x;
    });
  };
  const Positions reference = untangled(1);
  for (const int threads : {2, 5, 8}) EXPECT_TRUE(untangled(threads) == reference) << threads;
}

}  // namespace
}  // namespace piecework::untangle
