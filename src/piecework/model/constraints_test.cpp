#include <piecework/model/constraints.hpp>

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/model/measures.hpp>
#include <piecework/testing/newton_oracle.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::model {
namespace {

TEST(Constraints, MassIsDensityTimesArea) {
  const auto model = testing::cloth_model(testing::grid_mesh(7, 9, 2.0), testing::cotton());
  EXPECT_NEAR(model.mass.sum(), 0.5 * 4.0, 1e-12);
  EXPECT_GT(model.mass.minCoeff(), 0);
}

TEST(Constraints, BendingIsThereOnlyIfAskedFor) {
  const auto mesh = testing::grid_mesh(4, 4);
  EXPECT_TRUE(testing::cloth_model(mesh, testing::cotton(std::nullopt)).bend.empty());
  const auto model = testing::cloth_model(mesh, testing::cotton(1e-3));
  EXPECT_EQ(model.bend.size(), model.hinges.size());
  for (const BendConstraint& bend : model.bend)
    EXPECT_EQ(bend.rest_length, 0.0) << "a flat sheet is flat";
}

TEST(Constraints, HingeCoefficientsOfTheUnitSquare) {
  // Square (0,0) (1,0) (1,1) (0,1) cut along (0,0)-(1,1): the angles at the cut are 45 degrees.
  const std::array<Vec2, 3> t0{Vec2(0, 0), Vec2(1, 1), Vec2(1, 0)};
  const std::array<Vec2, 3> t1{Vec2(0, 0), Vec2(1, 1), Vec2(0, 1)};
  const auto c = hinge_coefficients(t0, t1);
  const double expected[] = {2, 2, -2, -2};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(c[i], expected[i], 1e-14);
}

// Rolling a sheet into a cylinder of radius r costs D / (2 r^2) per area on an isotropic mesh; the
// form is 3 (k1^2 + k2^2) - 2 k1 k2 over 3 (docs/architecture.md, D6). An alternating grid spreads
// between 1 and 1.5, so a band, not a value, is tested.
TEST(Constraints, BendingStiffnessIsTheFlexuralRigidity) {
  const auto flat = testing::grid_mesh(31, 31);
  const double D = 1e-3;
  const double r = 2.0;
  const auto model = testing::cloth_model(flat, testing::cotton(D));
  Positions rolled = flat.positions;
  for (Eigen::Index v = 0; v < rolled.rows(); ++v) {
    const double angle = flat.positions(v, 0) / r;
    rolled.row(v) << r * std::sin(angle), r * (1 - std::cos(angle)), flat.positions(v, 2);
  }
  double energy = 0;
  for (const BendConstraint& bend : model.bend) {
    Vec3 curvature = Vec3::Zero();
    for (std::size_t i = 0; i < 4; ++i)
      curvature += bend.coefficient[i] * rolled.row(bend.vertices[i]).transpose();
    energy += 0.5 * bend.weight * curvature.squaredNorm();
  }
  const double expected = D / (2 * r * r);
  EXPECT_GT(energy / expected, 0.9);
  EXPECT_LT(energy / expected, 1.6);
}

TEST(Constraints, CurvedRestShapeRemembersItsCurvature) {
  const auto sphere = testing::sphere_mesh(2);
  const auto model = testing::cloth_model(sphere, testing::cotton(1e-3));
  ASSERT_FALSE(model.bend.empty());
  for (const BendConstraint& bend : model.bend) {
    EXPECT_GT(bend.rest_length, 0);
    Vec3 curvature = Vec3::Zero();
    for (std::size_t i = 0; i < 4; ++i)
      curvature += bend.coefficient[i] * sphere.positions.row(bend.vertices[i]).transpose();
    EXPECT_NEAR(curvature.norm(), bend.rest_length, 1e-12);
  }
}

TEST(Constraints, RestFromTextureCoordinatesIsFlat) {
  auto mesh = testing::grid_mesh(3, 3);
  std::vector<Vec2> uv;
  for (const Triangle& t : mesh.triangles)
    for (const int v : t) uv.emplace_back(2 * mesh.positions(v, 0), mesh.positions(v, 2));
  ClothPart part{.name = "p",
                 .triangles = mesh.triangles,
                 .rest = rest_from_uv(uv, mesh.triangles, "p"),
                 .start = mesh.positions,
                 .material = testing::cotton()};
  const auto model = build_model({part});
  EXPECT_NEAR(model.mass.sum(), 0.5 * 2.0, 1e-12) << "mass comes from the rest area";
  for (const float strain : triangle_strain(model, mesh.positions)) EXPECT_NEAR(strain, 0.5F, 1e-6);
}

TEST(Constraints, StrainOfAKnownStretch) {
  const auto mesh = testing::grid_mesh(5, 5);
  const auto model = testing::cloth_model(mesh, testing::cotton());
  Positions x = mesh.positions;
  for (const float strain : triangle_strain(model, x)) EXPECT_NEAR(strain, 0, 1e-7);
  x.col(0) *= 1.25;
  for (const float strain : triangle_strain(model, x)) EXPECT_NEAR(strain, 0.25F, 1e-6);
  x.setZero();
  for (const float strain : triangle_strain(model, x)) EXPECT_NEAR(strain, 1.0F, 1e-6);
}

TEST(Constraints, PartsAreNumberedOneAfterTheOther) {
  const auto a = testing::grid_mesh(3, 3);
  const auto b = testing::grid_mesh(4, 2);
  const auto part = [](const char* name, const mesh::TriangleMesh& mesh, const Material& material) {
    return ClothPart{name, mesh.triangles,
                     rest_from_positions(mesh.positions, mesh.triangles, name), mesh.positions,
                     material};
  };
  const auto model =
      build_model({part("a", a, testing::cotton()), part("b", b, testing::cotton(std::nullopt))});
  ASSERT_EQ(model.parts.size(), 2U);
  EXPECT_EQ(model.parts[1].first_vertex, 9);
  EXPECT_EQ(model.parts[1].first_triangle, 8);
  EXPECT_EQ(model.num_vertices(), 17);
  int bending = 0;
  for (std::size_t h = 0; h < model.hinges.size(); ++h) {
    bending += model.hinge_bends[h];
    EXPECT_EQ(model.hinges[h].vertices[0] < 9, model.hinge_bends[h] == 1);
  }
  EXPECT_EQ(static_cast<std::size_t>(bending), model.bend.size());
}

TEST(Constraints, RefusesBadConstantsByName) {
  const auto mesh = testing::grid_mesh(3, 3);
  const auto message = [&](Material material) -> std::string {
    try {
      testing::cloth_model(mesh, material);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  Material m = testing::cotton();
  m.density = 0;
  EXPECT_NE(message(m).find("density = 0"), std::string::npos) << message(m);
  m = testing::cotton();
  m.stretching = -1;
  EXPECT_NE(message(m).find("stretching = -1"), std::string::npos);
  m.stretching = std::numeric_limits<double>::infinity();
  EXPECT_NE(message(m).find("stretching"), std::string::npos);
  m = testing::cotton(std::nan(""));
  EXPECT_NE(message(m).find("bending"), std::string::npos);
}

TEST(Constraints, RefusesZeroAreaByTriangle) {
  auto mesh = testing::grid_mesh(3, 3);
  mesh.positions.row(1) = mesh.positions.row(0);
  try {
    rest_from_positions(mesh.positions, mesh.triangles, "sheet");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("sheet: triangle"), std::string::npos) << error.what();
  }
  EXPECT_THROW(rest_from_uv({}, mesh.triangles, "sheet"), InputError);
}

}  // namespace
}  // namespace piecework::model
