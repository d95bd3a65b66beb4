#include <piecework/runner/world.hpp>

#include <set>

#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

/// The small scene with its only cloth's object replaced.
scene::Scene with_cloth(const std::string& cloth) {
  return scene::parse_scene(
      R"({"name": "t", "solver": {"domains": 2}, "materials": {"m": {"bending": 1e-3}}, "cloths": [)" +
          cloth + "]}",
      "t.json");
}

TEST(World, BuildsWhatTheSceneSays) {
  const auto world = build_world(small_scene());
  EXPECT_EQ(world->model.num_vertices(), 56);
  EXPECT_EQ(world->domains.num_domains, 4);
  EXPECT_EQ(world->pins.at(0).vertices, (std::vector<int>{0, 7}));
  ASSERT_TRUE(world->forces.wind.has_value());
  ASSERT_TRUE(world->forces.gravity.has_value());
  EXPECT_EQ(world->forces.gravity->y(), -9.81);
}

TEST(World, WhatTheSceneDoesNotNameIsOff) {
  const auto world = build_world(scene::parse_scene(
      R"({"name": "t", "gravity": null, "materials": {"m": {}}, "cloths": [{"material": "m", "mesh": {"generator": "sheet", "columns": 4, "rows": 4}}]})",
      "t.json"));
  EXPECT_FALSE(world->forces.gravity);
  EXPECT_FALSE(world->forces.wind);
  EXPECT_TRUE(world->forces.loads.empty());
  EXPECT_TRUE(world->pins.empty());
  EXPECT_TRUE(world->model.bend.empty());
}

TEST(World, PlacesScalesTurnsAndMoves) {
  const auto world = build_world(with_cloth(
      R"({"material": "m", "mesh": {"generator": "sheet", "columns": 3, "rows": 3}, "scale": [2, 1, 1], "rotate": [0, 90, 0], "translate": [10, 0, 0]})"));
  // (1, 0, 0) -> scaled (2, 0, 0) -> a quarter turn about y (0, 0, -2) -> (10, 0, -2)
  EXPECT_LT((world->model.start.row(2) - Eigen::RowVector3d(10, 0, -2)).norm(), 1e-12);
  // The rest shape is unscaled: the start shape is stretched.
  EXPECT_NEAR(world->model.mass.sum(), 0.5, 1e-12);
}

TEST(World, RegionsByBoxSphereAndSet) {
  const auto pins = [](const std::string& region) {
    const auto world = build_world(with_cloth(
        R"({"material": "m", "mesh": {"generator": "sheet", "columns": 5, "rows": 5}, "pins": [{"region": )" +
        region + "}]}"));
    return world->pins.at(0).vertices;
  };
  EXPECT_EQ(pins(R"({"box": [[-1, -1, -1], [0.3, 1, 0.1]]})"), (std::vector<int>{0, 1}));
  EXPECT_EQ(pins(R"({"sphere": [1, 0, 1, 0.01]})"), (std::vector<int>{24}));
  EXPECT_EQ(pins(R"({"sets": ["border"]})").size(), 16U);
  EXPECT_EQ(pins(R"({"vertices": [24, 0], "sphere": [1, 0, 1, 0.01]})"), (std::vector<int>{0, 24}))
      << "a union, each once";
}

TEST(World, TableclothHangsByItsCornersAtEveryResolution) {
  for (const int side : {100, 20}) {
    const std::string value = std::to_string(side);
    const auto world = build_world(
        scene::load_scene(std::string(PIECEWORK_SOURCE_DIR) + "/scenes/hanging_tablecloth.json",
                          {{"cloths.0.mesh.columns", value}, {"cloths.0.mesh.rows", value}}));
    ASSERT_EQ(world->pins.size(), 2U);
    EXPECT_EQ(world->pins[0].vertices, std::vector<int>{0});
    EXPECT_EQ(world->pins[1].vertices, std::vector<int>{side - 1});
  }
}

TEST(World, RefusalsSayWhereAndWhatToDo) {
  const std::string mesh = R"("mesh": {"generator": "sheet", "columns": 3, "rows": 3})";
  const auto region = [&](const std::string& text) {
    return refusal(
        with_cloth(R"({"material": "m", )" + mesh + R"(, "pins": [{"region": )" + text + "}]}"));
  };
  EXPECT_NE(region(R"({"vertices": [9]})")
                .find("/cloths/0/pins/0/region/vertices: vertex 9 does not exist; the mesh has "
                      "vertices 0 to 8"),
            std::string::npos);
  EXPECT_NE(region(R"({"sets": ["hem"]})").find("\"hem\"; it has: border"), std::string::npos);
  EXPECT_NE(region(R"({"sphere": [5, 5, 5, 0.1]})").find("no vertex lies in this region"),
            std::string::npos);
  EXPECT_NE(refusal(with_cloth(R"({"material": "m", "mesh": {"file": "/nowhere/x.obj"}})"))
                .find("/nowhere/x.obj"),
            std::string::npos);
}

// A file with quads, an unused-free vertex order that is not the face order, and texture
// coordinates twice as large as the shape: rest "uv" makes it want to grow.
TEST(World, FileOrderOfVerticesAndRestShapeFromTextureCoordinates) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "quad.obj";
  write_file_atomically(
      path,
      "v 1 0 1\nv 0 0 1\nv 0 0 0\nv 1 0 0\nvt 2 2\nvt 0 2\nvt 0 0\nvt 2 0\nf 3/3 2/2 1/1 4/4\n");
  const auto cloth = [&](const std::string& rest) {
    return R"({"material": "m", "mesh": {"file": ")" + path.string() + R"("}, "rest": ")" + rest +
           R"(", "pins": [{"region": {"vertices": [2]}}]})";
  };
  const auto self = build_world(with_cloth(cloth("self")));
  const int pinned = self->pins.at(0).vertices.at(0);
  EXPECT_TRUE(self->model.start.row(pinned).isZero()) << "file vertex 2 is the origin";
  EXPECT_NEAR(self->model.mass.sum(), 0.5, 1e-12);
  EXPECT_NEAR(build_world(with_cloth(cloth("uv")))->model.mass.sum(), 4 * 0.5, 1e-12);
}

TEST(World, RestShapeFromAnotherFileNeedsTheSameFaces) {
  const TemporaryFolder folder;
  const auto a = folder.path() / "a.obj";
  const auto b = folder.path() / "b.obj";
  const auto c = folder.path() / "c.obj";
  write_file_atomically(a, "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\n");
  write_file_atomically(b, "v 0 0 0\nv 3 0 0\nv 0 0 1\nf 1 3 2\n");
  write_file_atomically(c, "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 1 0 1\nf 1 3 2\nf 2 3 4\n");
  const auto cloth = [&](const std::filesystem::path& rest) {
    return R"({"material": "m", "mesh": {"file": ")" + a.string() +
           R"("}, "rest": "file", "rest_file": ")" + rest.string() + "\"}";
  };
  EXPECT_NEAR(build_world(with_cloth(cloth(b)))->model.mass.sum(), 0.5 * 1.5, 1e-12);
  EXPECT_NE(refusal(with_cloth(cloth(c))).find("c.obj: "), std::string::npos);
}

}  // namespace
}  // namespace piecework::runner
