#include <piecework/colliders/audit.hpp>

#include <gtest/gtest.h>

#include <piecework/colliders/solid_test_util.hpp>
#include <piecework/mesh/solids.hpp>

namespace piecework::colliders {
namespace {

Positions random_points(int count, double extent) {
  Random random(11);
  Positions points(count, 3);
  for (int i = 0; i < count; ++i) points.row(i) = random_point(random, extent).transpose();
  return points;
}

MeshCollider collider(const mesh::TriangleMesh& mesh, const RigidMotion& motion = {}) {
  return {{"body", {}, {}}, mesh, Eigen::Affine3d::Identity(), motion};
}

// Against the winding number by solid angles, on a body of four pieces that overlap.
TEST(Audit, FindsWhatIsInside) {
  const mesh::TriangleMesh pot = mesh::pot(0.6, 24);
  const Positions points = random_points(3000, 1);
  const std::vector<int> inside = points_inside(pot.triangles, pot.positions, points);
  std::vector<int> expected;
  for (int i = 0; i < points.rows(); ++i)
    if (winding_number(pot, points.row(i)) > 0.5) expected.push_back(i);
  EXPECT_GT(expected.size(), 100U);
  EXPECT_EQ(inside, expected);
}

// Rays through vertices and along edges and faces of an axis-aligned grid.
TEST(Audit, RaysThroughVerticesAndEdgesAreDecided) {
  const mesh::TriangleMesh box = mesh::box(Vec3(2, 2, 2), 0.5, 2);
  Positions points(5 * 5 * 3, 3);
  Eigen::Index row = 0;
  for (const double y : {-1.0, -0.5, 0.0, 0.5, 1.0})
    for (const double z : {-1.0, -0.5, 0.0, 0.5, 1.0})
      for (const double x : {-3.0, 0.125, 3.0}) points.row(row++) << x, y, z;
  const std::vector<int> inside = points_inside(box.triangles, box.positions, points);
  int found = 0;
  for (const int i : inside) {
    EXPECT_EQ(points(i, 0), 0.125);
    EXPECT_LE(points.row(i).cwiseAbs().maxCoeff(), 1);
    found += points.row(i).cwiseAbs().maxCoeff() < 1;
  }
  EXPECT_EQ(found, 9) << "all that are not on the surface";
}

TEST(Audit, DepthAndCountOfPenetration) {
  const Positions points = random_points(500, 1.2);
  const Audit ball = audit(collider(mesh::icosphere(1, 24)), points, {});
  int inside = 0;
  double deepest = 0;
  for (int i = 0; i < points.rows(); ++i)
    if (points.row(i).norm() < 1) ++inside, deepest = std::max(deepest, 1 - points.row(i).norm());
  EXPECT_NEAR(static_cast<double>(ball.inside.size()), inside, 2) << "chords";
  EXPECT_NEAR(ball.depth, deepest, 2e-3);
  const AnalyticCollider exact({"ball", {}, {}}, Sphere{Vec3::Zero(), 1},
                               Eigen::Isometry3d::Identity(), {});
  const Audit analytic = audit(exact, points, {});
  EXPECT_EQ(static_cast<int>(analytic.inside.size()), inside);
  EXPECT_DOUBLE_EQ(analytic.depth, deepest);
  EXPECT_GT(inside, 50);
}

TEST(Audit, InsideOutOpenFlatAndDouble) {
  const Positions points = random_points(50, 3);
  mesh::TriangleMesh box = mesh::box(Vec3(1, 2, 3));
  const Audit sound = audit(collider(box), points, {});
  EXPECT_TRUE(sound.closed);
  EXPECT_NEAR(sound.volume, 6, 1e-12);
  EXPECT_LT((sound.high - sound.low - Vec3(1, 2, 3)).norm(), 1e-15);
  for (Triangle& t : box.triangles) std::swap(t[0], t[1]);
  const Audit turned = audit(collider(box), points, {});
  EXPECT_NEAR(turned.volume, -6, 1e-12);
  EXPECT_EQ(turned.inside, sound.inside);
  box.triangles.push_back({0, 1, 1});
  box.triangles.push_back(box.triangles.front());
  const Audit broken = audit(collider(box), points, {});
  EXPECT_FALSE(broken.closed);
  EXPECT_TRUE(broken.inside.empty());
  EXPECT_EQ(broken.zero_area, 1);
  EXPECT_EQ(broken.duplicates, 1);
}

TEST(Audit, WayPerStep) {
  RigidMotion motion;
  motion.rate = 2;
  motion.start = 0.5;
  const AuditOptions options{.h = 0.01, .steps = 100};
  const Positions points = random_points(5, 3);
  // A chord of the circle of the corners.
  const double expected = 2 * std::sqrt(2.0) * std::sin(0.01);
  EXPECT_NEAR(audit(collider(mesh::box(Vec3(2, 1, 2)), motion), points, options).step_displacement,
              expected, 1e-12);
  const AnalyticCollider exact({"box", {}, {}}, Box{Vec3::Zero(), Vec3(1, 0.5, 1), 0},
                               Eigen::Isometry3d::Identity(), motion);
  EXPECT_NEAR(audit(exact, points, options).step_displacement, expected, 1e-12);
  EXPECT_EQ(audit(collider(mesh::box(Vec3(2, 1, 2))), points, options).step_displacement, 0);
}

TEST(Audit, SaysInWordsWhatItFound) {
  Audit bad;
  bad.num_triangles = 12;
  bad.high = Vec3(100, 1, 1);
  bad.volume = -100;
  bad.zero_area = 3;
  bad.duplicates = 2;
  bad.step_displacement = 0.02;
  bad.inside = {4, 5};
  bad.depth = 0.003;
  const std::vector<std::string> lines = notes(bad, {"rock", {}, 0.001}, 1);
  const std::vector<std::string> expected{
      "collider rock: 12 triangles, closed, 100 x 1 x 1 m, moves up to 20 mm per step",
      "collider rock: 100 times as large as the cloth; check its units",
      "collider rock: inside out (volume -100 m^3); turn its triangles around",
      "collider rock: 3 triangles without area",
      "collider rock: 2 duplicate triangles",
      "collider rock: moves 20 mm per step, more than its thickness of 1 mm; smaller steps lose "
      "less contact",
      "collider rock: 2 cloth vertices start inside, the deepest 3 mm deep"};
  EXPECT_EQ(lines, expected);
  Audit plane;
  plane.bounded = false;
  EXPECT_EQ(notes(plane, {"floor", {}, {}}, 1),
            std::vector<std::string>{"collider floor: an exact solid without bounds"});
}

}  // namespace
}  // namespace piecework::colliders
