#include <piecework/colliders/shapes.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <piecework/colliders/collider.hpp>
#include <piecework/colliders/solid_test_util.hpp>
#include <piecework/colliders/tessellation.hpp>
#include <piecework/core/error.hpp>

namespace piecework::colliders {
namespace {

struct Example {
  const char* name;
  Shape shape;
  bool bounded = true;
};

std::vector<Plane> cube_planes(const Vec3& center, const Vec3& half) {
  std::vector<Plane> planes;
  for (Eigen::Index axis = 0; axis < 3; ++axis)
    for (const double side : {1.0, -1.0})
      planes.push_back({center + side * half[axis] * Vec3::Unit(axis), side * Vec3::Unit(axis)});
  return planes;
}

/// A pyramid of five sides and a base: at its apex more than three planes meet.
std::vector<Plane> pyramid_planes() {
  std::vector<Plane> planes{{Vec3(0, -0.5, 0), -Vec3::UnitY()}};
  for (int i = 0; i < 5; ++i) {
    const double angle = 2 * std::numbers::pi * i / 5;
    planes.push_back({Vec3(0, 0.9, 0), Vec3(std::cos(angle), 0.6, std::sin(angle))});
  }
  return planes;
}

const std::vector<Example>& examples() {
  static const Vec3 center(0.1, -0.2, 0.3), half(0.7, 0.4, 0.9);
  static const std::vector<Example> all = {
      {"plane", Plane{Vec3(0.1, 0.2, 0), Vec3(1, 2, -3)}, false},
      {"sphere", Sphere{center, 0.8}},
      {"capsule", Capsule{Vec3(-0.4, 0.1, 0), Vec3(0.5, 0.3, 0.2), 0.5}},
      {"capsule of length 0", Capsule{center, center, 0.5}},
      {"box", Box{center, half, 0}},
      {"rounded box", Box{center, half, 0.15}},
      {"box rounded to its core", Box{center, half, 0.4}},
      {"cylinder", Cylinder{Vec3(-0.4, 0.1, 0), Vec3(0.5, 0.5, 0.2), 0.6, 0}},
      {"rounded cylinder", Cylinder{Vec3(-0.4, 0.1, 0), Vec3(0.5, 0.5, 0.2), 0.6, 0.2}},
      {"cube of half-spaces", HalfSpaces(cube_planes(center, half))},
      {"pyramid", HalfSpaces(pyramid_planes())},
      {"corner",
       HalfSpaces({{center, Vec3(1, 0, 0.2)}, {center, Vec3(0, 1, 0)}, {center, Vec3(0, 0.3, 1)}}),
       false},
      {"wedge", HalfSpaces({{center, Vec3(1, 1, 0)}, {center, Vec3(-1, 1, 0)}}), false},
      {"slab", HalfSpaces({{center, Vec3(1, 1, 0)}, {Vec3(-1, -1, 0), Vec3(-1, -1, 0)}}), false}};
  return all;
}

TEST(Shapes, VerticesOfTheTessellationLieOnTheSurface) {
  for (const Example& example : examples()) {
    SCOPED_TRACE(example.name);
    const mesh::TriangleMesh mesh = tessellate(example.shape, 3);
    ASSERT_GT(mesh.num_triangles(), 0);
    for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v)
      EXPECT_NEAR(signed_distance(example.shape, mesh.positions.row(v)).distance, 0, 1e-12);
  }
}

TEST(Shapes, ClosedSurfacesAreClosedAndEncloseTheSolid) {
  for (const Example& example : examples()) {
    if (!example.bounded) continue;
    for (const int quarter : {1, 2, 5, 16}) {
      SCOPED_TRACE(fmt::format("{}, {} chords", example.name, quarter));
      const mesh::TriangleMesh mesh = closed_surface(example.shape, quarter, "body");
      const MeshCollider collider({"body", {}, {}}, mesh, Eigen::Affine3d::Identity(), {});
      EXPECT_TRUE(collider.closed());
      for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v)
        EXPECT_NEAR(signed_distance(example.shape, mesh.positions.row(v)).distance, 0, 1e-9);
    }
  }
}

TEST(Shapes, ClosedSurfacesOfFewChordsLieInsideOfTheSolid) {
  for (const Example& example : examples()) {
    if (!example.bounded) continue;
    SCOPED_TRACE(example.name);
    const mesh::TriangleMesh mesh = closed_surface(example.shape, 3, "body");
    Random random(5);
    int inside = 0;
    for (int i = 0; i < 300; ++i) {
      const Vec3 p = random_point(random, 1.2);
      const double distance = signed_distance(example.shape, p).distance;
      constexpr double kChords = 0.1;
      if (distance < 0 && distance > -kChords) continue;
      EXPECT_NEAR(winding_number(mesh, p), distance < 0 ? 1 : 0, 1e-6);
      inside += distance < 0;
    }
    EXPECT_GT(inside, 2);
  }
}

TEST(Shapes, HalfSpacesWithoutEndHaveNoClosedSurface) {
  int refused = 0;
  for (const Example& example : examples()) {
    if (example.bounded || std::holds_alternative<Plane>(example.shape)) continue;
    try {
      (void)closed_surface(example.shape, 1, "the body");
      ADD_FAILURE() << example.name;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("the body: its planes leave a side open"),
                std::string::npos);
      ++refused;
    }
  }
  EXPECT_EQ(refused, 3);
}

// The oracle: brute force over triangles, and their winding number for the sign. Round shapes lie
// outside of their chords by up to 1 % of their radius.
TEST(Shapes, DistanceIsThatOfTheTriangles) {
  constexpr double kChords = 4e-3;
  for (const Example& example : examples()) {
    if (!example.bounded) continue;
    SCOPED_TRACE(example.name);
    const mesh::TriangleMesh mesh = tessellate(example.shape, 3);
    Random random(3);
    int inside = 0, outside = 0;
    for (int i = 0; i < 300; ++i) {
      const Vec3 p = random_point(random, 1.5);
      const double distance = signed_distance(example.shape, p).distance;
      EXPECT_NEAR(std::abs(distance), distance_to_triangles(mesh, p), kChords);
      if (std::abs(distance) < kChords) continue;
      EXPECT_NEAR(winding_number(mesh, p), distance < 0 ? 1 : 0, 1e-6);
      ++(distance < 0 ? inside : outside);
    }
    EXPECT_GT(inside, 5);
    EXPECT_GT(outside, 100);
  }
}

// Unbounded solids: their triangles reach far beyond the points, so the cut does not matter.
TEST(Shapes, DistanceIsThatOfTheTrianglesOfUnboundedSolids) {
  for (const Example& example : examples()) {
    if (example.bounded) continue;
    SCOPED_TRACE(example.name);
    const mesh::TriangleMesh mesh = tessellate(example.shape, 20);
    Random random(4);
    int inside = 0;
    for (int i = 0; i < 300; ++i) {
      const Vec3 p = random_point(random, 1.5);
      const double distance = signed_distance(example.shape, p).distance;
      EXPECT_NEAR(std::abs(distance), distance_to_triangles(mesh, p), 1e-10);
      inside += distance < 0;
    }
    EXPECT_GT(inside, 20);
    EXPECT_LT(inside, 280);
  }
}

TEST(Shapes, DistancesAreOneLipschitz) {
  for (const Example& example : examples()) {
    SCOPED_TRACE(example.name);
    Random random(5);
    for (int i = 0; i < 5000; ++i) {
      const Vec3 p = random_point(random, 1.5);
      const Vec3 q = p + random_point(random, i % 2 == 0 ? 1.0 : 1e-6);
      const double change =
          signed_distance(example.shape, p).distance - signed_distance(example.shape, q).distance;
      EXPECT_LE(std::abs(change), (p - q).norm() + 1e-14);
    }
  }
}

TEST(Shapes, NormalIsTheGradient) {
  constexpr double kStep = 1e-6;
  for (const Example& example : examples()) {
    SCOPED_TRACE(example.name);
    Random random(6);
    int compared = 0;
    for (int i = 0; i < 1000; ++i) {
      const Vec3 p = random_point(random, 1.5);
      Vec3 gradient;
      bool smooth = true;
      const SignedDistance here = signed_distance(example.shape, p);
      EXPECT_NEAR(here.normal.norm(), 1, 1e-12);
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const SignedDistance above = signed_distance(example.shape, p + kStep * Vec3::Unit(axis));
        const SignedDistance below = signed_distance(example.shape, p - kStep * Vec3::Unit(axis));
        gradient[axis] = (above.distance - below.distance) / (2 * kStep);
        smooth = smooth && (above.normal - below.normal).norm() < 1e-3;
      }
      if (!smooth) continue;
      EXPECT_LT((gradient - here.normal).norm(), 1e-8);
      ++compared;
    }
    EXPECT_GT(compared, 950) << "kinks are rare";
  }
}

// Two descriptions of one solid that share no code: octants here, faces and edges there.
TEST(Shapes, HalfSpacesOfABoxAreTheBox) {
  const Vec3 center(0.1, -0.2, 0.3), half(0.7, 0.4, 0.9);
  for (const double rounding : {0.0, 0.1}) {
    const Shape box = Box{center, half, rounding};
    std::vector<Plane> planes = cube_planes(center, half);
    planes.push_back({Vec3(5, 0, 0), Vec3(1, 0, 0)});    // parallel, further out
    planes.push_back({center + half, Vec3(1, 1, 1)});    // touches a corner only
    planes.push_back({Vec3(0, 9, 0), Vec3(0.1, 1, 0)});  // far away
    if (rounding > 0) planes.erase(planes.begin() + 7);  // it would cut the rounded corner
    const Shape polyhedron = HalfSpaces(planes, rounding);
    Random random(7);
    for (int i = 0; i < 2000; ++i) {
      const Vec3 p = random_point(random, 2);
      const SignedDistance a = signed_distance(box, p);
      const SignedDistance b = signed_distance(polyhedron, p);
      EXPECT_NEAR(a.distance, b.distance, 1e-11);
      if (a.distance > 1e-6) {
        EXPECT_LT((a.normal - b.normal).norm(), 1e-6);
      }
    }
  }
}

TEST(Shapes, NormalsWhereThereIsNoGradient) {
  const auto expect = [](const Shape& shape, const Vec3& p, double distance, const Vec3& normal) {
    const SignedDistance result = signed_distance(shape, p);
    EXPECT_NEAR(result.distance, distance, 1e-15);
    EXPECT_LT((result.normal - normal).norm(), 1e-15) << result.normal.transpose();
  };
  expect(Sphere{Vec3(1, 2, 3), 0.5}, Vec3(1, 2, 3), -0.5, Vec3::UnitY());
  expect(Sphere{Vec3(0, 0, 0), 0.5}, Vec3(1e-300, 0, 0), -0.5, Vec3::UnitX());
  expect(Box{Vec3::Zero(), Vec3(1, 1, 1), 0}, Vec3::Zero(), -1, Vec3::UnitX());
  expect(Box{Vec3::Zero(), Vec3(1, 1, 1), 0}, Vec3(0, -0.5, -0.5), -0.5, -Vec3::UnitY());
  expect(Box{Vec3::Zero(), Vec3(1, 1, 1), 0}, Vec3(1, 1, 1), 0, Vec3::UnitX());
  expect(Cylinder{Vec3(0, -1, 0), Vec3(0, 1, 0), 2, 0}, Vec3(0, 0.5, 0), -0.5, Vec3::UnitY());
  expect(HalfSpaces({{Vec3::Zero(), Vec3::UnitX()}, {Vec3::Zero(), Vec3::UnitZ()}}), Vec3::Zero(),
         0, Vec3::UnitX());
  for (const Vec3& p : {Vec3(0, 0, 0), Vec3(0, 0.3, 0)}) {
    for (const Shape& shape :
         {Shape(Capsule{Vec3(0, -1, 0), Vec3(0, 1, 0), 0.5}), Shape(Capsule{p, p, 0.5}),
          Shape(Cylinder{Vec3(0, -1, 0), Vec3(0, 1, 0), 0.5, 0})}) {
      const SignedDistance on_axis = signed_distance(shape, p);
      EXPECT_NEAR(on_axis.distance, -0.5, 1e-15);
      EXPECT_NEAR(on_axis.normal.norm(), 1, 1e-15);
      EXPECT_NEAR(on_axis.normal.y(), 0, 1e-15);
    }
  }
}

TEST(Shapes, NonFiniteSizesAndMissingDirectionsAreRefused) {
  const auto refusal = [](const Shape& shape) -> std::string {
    try {
      validate(shape, "ball");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(Sphere{Vec3::Zero(), -1}), "ball: radius is -1 m; give a length above 0");
  EXPECT_NE(refusal(Sphere{Vec3(0, nan, 0), 1}).find("center is not finite"), std::string::npos);
  EXPECT_NE(refusal(Plane{Vec3::Zero(), Vec3::Zero()}).find("no direction"), std::string::npos);
  EXPECT_NE(refusal(Box{Vec3::Zero(), Vec3(1, 2, 3), 1.5}).find("rounding is 1.5 m; give 0 to 1 m"),
            std::string::npos);
  EXPECT_NE(refusal(Cylinder{Vec3::UnitX(), Vec3::UnitX(), 1, 0}).find("distance of from and to"),
            std::string::npos);
  EXPECT_EQ(refusal(Cylinder{Vec3::Zero(), Vec3::UnitX(), 1, 0.5}), "");
  EXPECT_NE(refusal(Cylinder{Vec3::Zero(), Vec3::UnitX(), 1, 0.6}).find("rounding"),
            std::string::npos);
  EXPECT_NE(refusal(Capsule{Vec3::Zero(), Vec3::UnitX(), nan}).find("radius"), std::string::npos);
}

TEST(Shapes, EmptyIntersectionsAreRefused) {
  const auto refusal = [](const std::vector<Plane>& planes, double rounding) -> std::string {
    try {
      HalfSpaces solid(planes, rounding);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const Plane below_0{Vec3::Zero(), Vec3::UnitY()};
  const Plane above_1{Vec3::UnitY(), -Vec3::UnitY()};
  const std::vector<Plane> wedge{{Vec3(0, -1, 0), Vec3(1, 1, 0)},
                                 {Vec3(0, -1, 0), Vec3(-1, 1, 0)},
                                 {Vec3::Zero(), -Vec3::UnitY()}};
  EXPECT_NE(refusal({below_0, above_1}, 0).find("no point lies below all 2 planes"),
            std::string::npos);
  EXPECT_NE(refusal(wedge, 0).find("no point lies below all 3 planes"), std::string::npos);
  EXPECT_NE(refusal({}, 0).find("0 planes"), std::string::npos);
  const std::vector<Plane> cube = cube_planes(Vec3(9, 9, 9), Vec3(1, 1, 1));
  EXPECT_EQ(refusal(cube, 0.9), "");
  EXPECT_NE(refusal(cube, 1.1).find("moved inward by the rounding"), std::string::npos);
}

}  // namespace
}  // namespace piecework::colliders
