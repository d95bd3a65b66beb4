#include <piecework/colliders/collider.hpp>

#include <gtest/gtest.h>

#include <numbers>

#include <piecework/colliders/solid_test_util.hpp>
#include <piecework/core/error.hpp>
#include <piecework/mesh/solids.hpp>

namespace piecework::colliders {
namespace {

RigidMotion spin() {
  RigidMotion motion;
  motion.velocity = Vec3(0.5, 0, -0.2);
  motion.axis = Vec3(1, 1, 0);
  motion.center = Vec3(0, 2, 0);
  motion.rate = 3;
  motion.start = 0.25;
  return motion;
}

Eigen::Isometry3d tilted() {
  Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
  placement.translate(Vec3(0.4, -0.3, 1));
  placement.rotate(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  return placement;
}

TEST(AnalyticCollider, CarriesPointsAsItMoves) {
  const AnalyticCollider box({"box", {}, {}}, Box{Vec3::Zero(), Vec3(1, 0.5, 0.2), 0}, tilted(),
                             spin());
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Vec3 local = random_point(random, 2);
    const Vec3 x0 = box.pose(0.1) * local;
    const Vec3 x1 = box.pose(1.7) * local;
    EXPECT_LT((box.carried(x0, 0.1, 1.7) - x1).norm(), 1e-13);
    EXPECT_LT((box.carried(x1, 1.7, 0.1) - x0).norm(), 1e-13);
    const SignedDistance before = box.signed_distance(x0, 0.1);
    const SignedDistance after = box.signed_distance(x1, 1.7);
    EXPECT_NEAR(before.distance, after.distance, 1e-13) << "it moves along";
    EXPECT_NEAR(before.distance, signed_distance(box.shape(), local).distance, 1e-13);
    EXPECT_LT((box.carried(x0 + before.normal, 0.1, 1.7) - x1 - after.normal).norm(), 1e-13);
  }
}

TEST(AnalyticCollider, AStaticOneCarriesNothing) {
  const AnalyticCollider ground({"ground", {}, {}}, Plane{}, tilted(), {});
  EXPECT_TRUE(ground.is_static());
  const Vec3 x(0.1, 0.2, 0.3);
  EXPECT_TRUE(ground.carried(x, 0, 1e6) == x) << "to the last bit";
}

TEST(AnalyticCollider, TrianglesMoveAlong) {
  const AnalyticCollider ball({"ball", {}, {}}, Capsule{Vec3(0, 0, 0), Vec3(1, 0, 0), 0.3},
                              tilted(), spin());
  const mesh::TriangleMesh start = ball.tessellate(0, 1);
  const mesh::TriangleMesh later = ball.tessellate(2, 1);
  EXPECT_EQ(start.triangles, later.triangles);
  EXPECT_GT((start.positions - later.positions).rowwise().norm().minCoeff(), 0.01);
  for (Eigen::Index v = 0; v < later.positions.rows(); ++v)
    EXPECT_NEAR(ball.signed_distance(later.positions.row(v), 2).distance, 0, 1e-12);
}

TEST(AnalyticCollider, NamesItselfInRefusals) {
  try {
    const AnalyticCollider ball({"ball", {}, {}}, Sphere{Vec3::Zero(), 0},
                                Eigen::Isometry3d::Identity(), {});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "ball: radius is 0 m; give a length above 0");
  }
}

double volume(const Triangles& triangles, const Positions& x) {
  double sum = 0;
  for (const Triangle& t : triangles) sum += x.row(t[0]).dot(x.row(t[1]).cross(x.row(t[2]))) / 6;
  return sum;
}

TEST(MeshCollider, StandsOrMovesRigidly) {
  const mesh::TriangleMesh box = mesh::box(Vec3(1, 2, 3));
  const MeshCollider still({"box", Friction{0.3}, 0.001}, box, Eigen::Affine3d::Identity(), {});
  EXPECT_TRUE(still.is_static());
  EXPECT_TRUE(still.closed());
  Positions x;
  still.positions_at(3, x);
  EXPECT_TRUE(x == box.positions) << "to the last bit";
  const MeshCollider moving({"box", {}, {}}, box, Eigen::Affine3d(tilted()), spin());
  EXPECT_FALSE(moving.is_static());
  moving.positions_at(1.5, x);
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    const Vec3 expected = spin().at(1.5) * (tilted() * Vec3(box.positions.row(v)));
    EXPECT_LT((Vec3(x.row(v)) - expected).norm(), 1e-14);
  }
}

TEST(MeshCollider, MirroringTurnsTheTriangles) {
  const Eigen::Affine3d mirror(Eigen::Scaling(-1.0, 1.0, 1.0));
  const MeshCollider collider({"box", {}, {}}, mesh::box(Vec3(1, 2, 3)), mirror, {});
  Positions x;
  collider.positions_at(0, x);
  EXPECT_NEAR(volume(collider.triangles(), x), 6, 1e-14);
}

TEST(MeshCollider, DeformsBeforeItIsPlacedAndMoved) {
  const mesh::TriangleMesh box = mesh::box(Vec3(1, 2, 3));
  const Deformation grow = [&](double time, Positions& out) { out = (1 + time) * box.positions; };
  const MeshCollider collider({"box", {}, {}}, box, Eigen::Affine3d(tilted()), spin(), grow);
  EXPECT_FALSE(collider.is_static());
  Positions x;
  collider.positions_at(1.5, x);
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    const Vec3 expected = spin().at(1.5) * (tilted() * (2.5 * Vec3(box.positions.row(v))));
    EXPECT_LT((Vec3(x.row(v)) - expected).norm(), 1e-14);
  }
}

TEST(MeshCollider, KnowsWhetherItIsClosed) {
  const auto closed = [](const mesh::TriangleMesh& mesh) {
    return MeshCollider({"m", {}, {}}, mesh, Eigen::Affine3d::Identity(), {}).closed();
  };
  mesh::TriangleMesh box = mesh::box(Vec3(1, 1, 1));
  EXPECT_TRUE(closed(box));
  mesh::TriangleMesh two = box;
  mesh::append(box, two);
  EXPECT_TRUE(closed(two)) << "pieces may be several";
  mesh::TriangleMesh open = box;
  open.triangles.pop_back();
  EXPECT_FALSE(closed(open));
  open.triangles.pop_back();
  EXPECT_FALSE(closed(open)) << "an even number of sides";
  mesh::TriangleMesh turned = box;
  std::swap(turned.triangles[0][0], turned.triangles[0][1]);
  EXPECT_FALSE(closed(turned));
  mesh::TriangleMesh crowded = box;
  crowded.triangles.insert(crowded.triangles.end(), {box.triangles[0], box.triangles[0]});
  EXPECT_FALSE(closed(crowded));
}

TEST(MeshCollider, RefusesWhatIsNoMesh) {
  const auto refusal = [](const mesh::TriangleMesh& mesh, const Vec3& scale) -> std::string {
    try {
      MeshCollider({"body", {}, {}}, mesh, Eigen::Affine3d(Eigen::Scaling(scale)), {});
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const mesh::TriangleMesh box = mesh::box(Vec3(1, 1, 1));
  const Vec3 one(1, 1, 1);
  EXPECT_EQ(refusal(box, one), "");
  mesh::TriangleMesh bad = box;
  bad.positions(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(bad, one), "body: vertex 3 is not at a finite position; correct the mesh");
  bad = box;
  bad.triangles[2][1] = 8;
  EXPECT_EQ(refusal(bad, one), "body: triangle 2 names vertex 8 of 8; correct the mesh");
  bad.triangles.clear();
  EXPECT_NE(refusal(bad, one).find("no triangles"), std::string::npos);
  EXPECT_NE(refusal(box, Vec3(1, 0, 1)).find("flattens"), std::string::npos);
}

}  // namespace
}  // namespace piecework::colliders
