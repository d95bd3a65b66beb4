// The first steps of the shipped scenes with contact, on coarse meshes: things touch, and nothing
// passes through anything. The whole scenes have expectations of their own.

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <piecework/runner/methods.hpp>
#include <piecework/runner/start.hpp>
#include <piecework/runner/world.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;

struct Beginning {
  const char* scene;
  int cloths;         ///< the first so many are made coarse
  int columns, rows;  ///< of their meshes
  int steps;          ///< at least until things touch
};

std::vector<scene::Override> coarse(const Beginning& beginning) {
  std::vector<scene::Override> overrides{{"solver.domains", "4"}};
  for (int i = 0; i < beginning.cloths; ++i) {
    overrides.push_back(
        {fmt::format("cloths.{}.mesh.columns", i), std::to_string(beginning.columns)});
    overrides.push_back({fmt::format("cloths.{}.mesh.rows", i), std::to_string(beginning.rows)});
  }
  return overrides;
}

/// Steps through a scene; returns the largest number of pairs in contact.
int touching_pairs(const scene::Scene& scene, int steps) {
  const auto world = build_world(scene);
  const auto integrator = make_integrator(*world);
  model::State state = start_state(*world, *integrator);
  int pairs = 0;
  for (int step = 1; step <= steps; ++step) {
    const model::StepReport report = integrator->step(state);
    EXPECT_TRUE(report.contact) << "step " << step;
    if (!report.contact) break;
    EXPECT_EQ(report.contact->interpenetrations, 0) << "step " << step;
    EXPECT_TRUE(report.converged) << "step " << step;
    pairs = std::max(pairs, report.contact->pairs);
  }
  return pairs;
}

class ContactScene : public ::testing::TestWithParam<Beginning> {};

TEST_P(ContactScene, TouchesAndNothingPassesThrough) {
  const scene::Scene scene = scene::load_scene(
      fs::path(PIECEWORK_SOURCE_DIR) / "scenes" / fmt::format("{}.json", GetParam().scene),
      coarse(GetParam()));
  EXPECT_TRUE(scene.self_collision);
  EXPECT_GT(touching_pairs(scene, GetParam().steps), 0);
}

INSTANTIATE_TEST_SUITE_P(All, ContactScene,
                         ::testing::Values(Beginning{"cloth_on_stairs", 1, 16, 20, 20},
                                           Beginning{"drape_on_sphere", 1, 16, 16, 30},
                                           Beginning{"folding", 4, 16, 7, 20},
                                           Beginning{"funnel", 1, 24, 6, 20},
                                           Beginning{"knot", 2, 61, 4, 60},
                                           Beginning{"pot_drape", 1, 16, 16, 20},
                                           Beginning{"sleeve_push", 1, 16, 16, 20},
                                           Beginning{"stack_of_20", 20, 4, 4, 20}),
                         [](const auto& beginning) { return std::string(beginning.param.scene); });

TEST(GarmentOnAvatar, TouchesAndNothingPassesThrough) {
  const fs::path data = PIECEWORK_SHARED_DATA;
  const fs::path garment = data / "garments/mhf_skirt_clean.obj";
  const fs::path figure = data / "avatars/mh_female.glb";
  if (!fs::exists(garment) || !fs::exists(figure)) GTEST_SKIP() << "no " << data;
  const scene::Scene scene =
      scene::load_scene(fs::path(PIECEWORK_SOURCE_DIR) / "scenes/garment_on_avatar.json",
                        {{"cloths.0.mesh.file", garment.string()},
                         {"colliders.0.avatar.file", figure.string()},
                         {"colliders.0.avatar.clip", "walk_131_01"}});
  EXPECT_GT(touching_pairs(scene, 6), 0);
}

// The corner cases of [Erleben 2018]: spikes, wedges, cliffs, cracks, holes and internal edges,
// half a metre large, under a sheet that falls onto them.
TEST(SharpColliders, TouchAndNothingPassesThrough) {
  const std::string folder = std::string(PIECEWORK_SHARED_DATA) + "/colliders/erleben/";
  if (!fs::exists(folder)) GTEST_SKIP() << "no shared data here";
  struct Solid {
    const char* name;
    double units, x, top, z;  ///< m; where the middle of its top is then
  };
  for (const Solid& solid :
       {Solid{"cliff", 0.333333, 0, 0.1667, 0}, Solid{"crack", 0.125, 0, 0.0625, 0},
        Solid{"hole", 0.25, 0, 0.125, 0}, Solid{"internal_edges", 0.25, 0, 0.125, 0},
        Solid{"spike", 0.166667, 0, 0.5001, 0}, Solid{"wedge", 0.166667, 0, 0.5001, 0}}) {
    SCOPED_TRACE(solid.name);
    const scene::Scene scene = scene::parse_scene(
        fmt::format(R"({{"self_collision": true, "friction": 0.3, "solver": {{"domains": 4}},
          "materials": {{"m": {{"density": 0.3, "stretching": 300, "bending": 1e-5}}}},
          "cloths": [{{"material": "m", "translate": [{}, {}, {}], "mesh": {{"generator": "sheet",
            "width": 0.8, "height": 0.8, "columns": 20, "rows": 20}}}}],
          "colliders": [{{"name": "solid", "shape": "mesh",
            "mesh": {{"file": "{}{}.obj", "units": {}, "repair": true}}}}]}})",
                    solid.x - 0.4, solid.top + 0.005, solid.z - 0.4, folder, solid.name,
                    solid.units),
        "solid.json");
    EXPECT_GT(touching_pairs(scene, 20), 0);
  }
}

}  // namespace
}  // namespace piecework::runner
