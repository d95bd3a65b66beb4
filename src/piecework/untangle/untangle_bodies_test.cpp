// Real garments on the bodies that they were fitted to. Skipped where the test data is absent.

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include <piecework/mesh/avatar.hpp>
#include <piecework/mesh/import.hpp>

#include "untangle_test_util.hpp"

namespace piecework::untangle {
namespace {

namespace fs = std::filesystem;

struct Garment {
  const char* name;
  const char* body;
  int inside;  ///< vertices at least that start inside of the body
};

class Garments : public ::testing::TestWithParam<Garment> {};

TEST_P(Garments, ComeOutOfTheirBodies) {
  const fs::path data = PIECEWORK_SHARED_DATA;
  const fs::path file = data / "garments" / (std::string(GetParam().name) + ".obj");
  if (!fs::exists(file)) GTEST_SKIP() << file.string() << " is absent";
  mesh::ImportOptions repairing;
  repairing.repair = true;
  TangledCloth cloth(mesh::import_mesh(file, repairing).mesh);
  mesh::AvatarOptions walking;
  walking.clip = "walk_131_01";
  const auto avatar = mesh::import_avatar(data / "avatars" / GetParam().body, walking);
  mesh::TriangleMesh body{.positions = {}, .triangles = avatar.triangles()};
  avatar.positions_at(0, body.positions);
  cloth.add(body, Vec3::Zero());
  cloth.options.distance = 1e-3;

  ASSERT_GT(cloth.intersections(), 0U);
  const UntangleReport report = cloth.untangle();
  EXPECT_GE(report.before.inside, GetParam().inside);
  EXPECT_EQ(report.after.total(), 0);
  EXPECT_EQ(cloth.intersections(), 0U);
  EXPECT_LT(report.largest_move, 0.03);
  EXPECT_LT(cloth.stretches()[1], 6);
}

INSTANTIATE_TEST_SUITE_P(
    MakeHuman, Garments,
    ::testing::Values(Garment{"mhf_fedora01", "mh_female.glb", 15},
                      Garment{"mhf_female_casualsuit01", "mh_female.glb", 300},
                      Garment{"mhf_female_casualsuit02", "mh_female.glb", 170},
                      Garment{"mhf_female_casualsuit02_clean", "mh_female.glb", 0},
                      Garment{"mhf_female_elegantsuit01", "mh_female.glb", 70},
                      Garment{"mhf_female_elegantsuit01_clean", "mh_female.glb", 0},
                      Garment{"mhf_female_sportsuit01", "mh_female.glb", 120},
                      Garment{"mhf_skirt", "mh_female.glb", 1},
                      Garment{"mhf_tights", "mh_female.glb", 2},
                      Garment{"mhf_tights_clean", "mh_female.glb", 0},
                      Garment{"mhm_male_casualsuit01", "mh_male.glb", 100},
                      Garment{"mhm_male_casualsuit02", "mh_male.glb", 4},
                      Garment{"mhm_male_casualsuit04", "mh_male.glb", 4},
                      Garment{"mhm_male_worksuit01", "mh_male.glb", 36},
                      Garment{"mhm_male_worksuit01_clean", "mh_male.glb", 0}),
    [](const auto& tested) { return std::string(tested.param.name); });

}  // namespace
}  // namespace piecework::untangle
