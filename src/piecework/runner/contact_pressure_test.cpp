#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include <piecework/runner/contact_pressure.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

/// A square metre of two triangles at a height, over a floor at 0 that rises by 1 m/s; the contact
/// energy is kappa/2 (d^ - d)^2 per vertex, with d^ = 1 mm and kappa = 2 N/m.
std::unique_ptr<World> over_floor(double height) {
  return build_world(scene::parse_scene(
      fmt::format(R"({{"name": "t", "solver": {{"domains": 1}}, "materials": {{"m": {{}}}},
          "contact": {{"barrier": "none", "distance": 1e-3, "stiffness": 2}},
          "cloths": [{{"material": "m", "translate": [0, {}, 0],
                     "mesh": {{"generator": "sheet", "columns": 2, "rows": 2}}}}],
          "colliders": [{{"shape": "plane", "motion": {{"velocity": [0, 1, 0]}}}}]}})",
                  height),
      "t.json"));
}

TEST(ContactPressure, IsTheForceOnVerticesPerArea) {
  const auto world = over_floor(0.6e-3);
  const std::vector<float> pressure = contact_pressure(*world, world->model.start, 0);
  ASSERT_EQ(pressure.size(), 2U);
  // F = kappa (d^ - d) on each vertex. Two vertices have a third of both triangles, 1/3 m^2, two of
  // one, 1/6 m^2; a triangle has two of the first and one of the second.
  const double force = 2 * (1e-3 - 0.6e-3);
  const double expected = (force / (1.0 / 3) * 2 + force / (1.0 / 6)) / 3;
  for (const float p : pressure) EXPECT_NEAR(p, expected, 1e-6 * expected);
}

TEST(ContactPressure, LooksAtCollidersWhereTheyAreThen) {
  const auto world = over_floor(3e-3);
  for (const float p : contact_pressure(*world, world->model.start, 0)) EXPECT_EQ(p, 0);
  for (const float p : contact_pressure(*world, world->model.start, 2.5e-3)) EXPECT_GT(p, 0);
}

}  // namespace
}  // namespace piecework::runner
