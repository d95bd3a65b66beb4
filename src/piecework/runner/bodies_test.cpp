#include <filesystem>

#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/runner/checkpoint.hpp>
#include <piecework/runner/world.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

/// A metre of cloth at height 1 over the given colliders.
scene::Scene with_colliders(const std::string& colliders) {
  return scene::parse_scene(
      R"({"name": "t", "solver": {"domains": 2}, "materials": {"m": {}}, "cloths": [{"material": "m",
          "mesh": {"generator": "sheet", "columns": 5, "rows": 5}, "translate": [0, 1, 0]}],
          "colliders": [)" +
          colliders + "]}",
      "t.json");
}

double distance(const std::string& collider, const Vec3& x, double time = 0) {
  const auto world = build_world(with_colliders(collider));
  return world->analytic_colliders.at(0).signed_distance(x, time).distance;
}

bool mentions(const World& world, const std::string& text) {
  for (const std::string& note : world.notes)
    if (note.find(text) != std::string::npos) return true;
  return false;
}

TEST(Bodies, ExactShapesAreWhatTheSceneSays) {
  EXPECT_NEAR(
      distance(R"({"shape": "plane", "point": [0, 0.5, 0], "normal": [0, 2, 0]})", Vec3(9, 2, 9)),
      1.5, 1e-14);
  EXPECT_NEAR(
      distance(R"({"shape": "sphere", "center": [1, 0, 0], "radius": 0.25})", Vec3(3, 0, 0)), 1.75,
      1e-14);
  EXPECT_NEAR(distance(R"({"shape": "capsule", "from": [0, 0, 0], "to": [0, 0, 2], "radius": 0.5})",
                       Vec3(2, 0, 1)),
              1.5, 1e-14);
  EXPECT_NEAR(distance(R"({"shape": "box", "size": [2, 4, 6]})", Vec3(0, 0, 5)), 2, 1e-14);
  EXPECT_NEAR(distance(R"({"shape": "box", "size": [2, 4, 6], "rotate": [0, 90, 0],
                           "translate": [1, 0, 0]})",
                       Vec3(5, 0, 0)),
              1, 1e-14);
  EXPECT_NEAR(distance(R"({"shape": "cylinder", "to": [0, 3, 0], "radius": 1})", Vec3(3, 1, 0)), 2,
              1e-14);
  EXPECT_NEAR(distance(R"({"shape": "half_spaces", "planes": [{"normal": [1, 0, 0]},
                           {"normal": [0, 1, 0]}]})",
                       Vec3(3, 4, 0)),
              5, 1e-14);
  EXPECT_NEAR(distance(R"({"shape": "sphere", "motion": {"velocity": [0, 2, 0], "stop": 1}})",
                       Vec3(0, 5, 0), 3),
              2.5, 1e-14);
}

TEST(Bodies, MeshesArePlacedAndMoved) {
  const auto world = build_world(with_colliders(
      R"({"name": "pot", "shape": "mesh", "mesh": {"generator": "pot", "radius": 0.5, "columns": 16},
          "scale": [2, 1, 1], "rotate": [0, 90, 0], "translate": [0, 0, 7], "friction": 0.4,
          "thickness": 0.002, "motion": {"velocity": [0, 1, 0]}})"));
  ASSERT_EQ(world->mesh_colliders.size(), 1U);
  const colliders::MeshCollider& pot = world->mesh_colliders[0];
  EXPECT_EQ(pot.traits().name, "pot");
  EXPECT_EQ(pot.traits().friction, colliders::Friction{0.4});
  EXPECT_EQ(pot.traits().thickness, 0.002);
  EXPECT_TRUE(pot.closed());
  EXPECT_FALSE(pot.is_static());
  Positions x;
  pot.positions_at(3, x);
  // The spout: along x, then stretched, then turned to -z.
  EXPECT_LT(x.col(2).minCoeff(), 7 - 2 * 0.8);
  EXPECT_NEAR(x.col(1).minCoeff(), 3, 1e-12);
  EXPECT_TRUE(mentions(*world, "collider pot: "));
  EXPECT_TRUE(mentions(*world, "more than its thickness of 2 mm"));
}

TEST(Bodies, EveryGeneratorOfBodiesIsClosed) {
  for (const char* generator : {"icosphere", "box", "stairs", "funnel", "pot"}) {
    const auto world = build_world(
        with_colliders(R"({"shape": "mesh", "translate": [0, -9, 0], "mesh": {"generator": ")" +
                       std::string(generator) + R"(", "rows": 8, "columns": 16}})"));
    EXPECT_TRUE(world->mesh_colliders.at(0).closed()) << generator;
    EXPECT_FALSE(mentions(*world, "inside")) << generator;
  }
}

TEST(Bodies, TrianglesOfAShapeLieOnItAndMoveWithIt) {
  const std::string shared = R"({"name": "post", "shape": "capsule", "from": [0, 0, 0],
      "to": [0, 0, 1], "radius": 0.25, "rotate": [0, 30, 0], "translate": [0, 5, 0],
      "friction": 0.4, "motion": {"velocity": [0, 1, 0], "rate": 2}, "surface": )";
  const auto exact = build_world(with_colliders(shared + "\"exact\"}"));
  const auto meshed = build_world(with_colliders(shared + "\"triangles\", \"segments\": 3}"));
  ASSERT_EQ(exact->analytic_colliders.size(), 1U);
  ASSERT_EQ(meshed->mesh_colliders.size(), 1U);
  EXPECT_TRUE(meshed->analytic_colliders.empty());
  const colliders::MeshCollider& post = meshed->mesh_colliders[0];
  EXPECT_TRUE(post.closed());
  EXPECT_EQ(post.traits().friction, colliders::Friction{0.4});
  EXPECT_EQ(post.num_vertices(), 2 + 6 * 12) << "two poles, and rings of 4 x 3";
  for (const double time : {0.0, 0.7}) {
    Positions x;
    post.positions_at(time, x);
    for (Eigen::Index v = 0; v < x.rows(); ++v)
      EXPECT_NEAR(exact->analytic_colliders[0].signed_distance(x.row(v), time).distance, 0, 1e-12);
  }
}

TEST(Bodies, KineticFrictionIsTheColliders) {
  const auto friction = [](const std::string& keys) {
    return build_world(with_colliders(R"({"shape": "plane")" + keys + "}"))
        ->analytic_colliders.at(0)
        .traits()
        .friction;
  };
  EXPECT_FALSE(friction("").has_value()) << "that of the scene";
  EXPECT_EQ(friction(R"(, "friction": 0.5)"), (colliders::Friction{0.5, 0.5}));
  EXPECT_EQ(friction(R"(, "friction": 0.5, "kinetic_friction": 0.2)"),
            (colliders::Friction{0.5, 0.2}));
  scene::Scene scene = with_colliders(R"({"shape": "plane"})");
  scene.friction = 0.7;
  scene.colliders[0].kinetic_friction = 0.1;
  EXPECT_EQ(build_world(scene)->analytic_colliders.at(0).traits().friction,
            (colliders::Friction{0.7, 0.1}));
}

TEST(Bodies, SequencesOfFiles) {
  const TemporaryFolder folder;
  for (const int frame : {1, 2})
    write_file_atomically(folder.path() / ("b_0" + std::to_string(frame) + ".obj"),
                          "v 0 " + std::to_string(frame) + " 0\nv 0 0 1\nv 1 0 0\nf 1 2 3\n");
  const auto world = build_world(
      with_colliders(R"({"shape": "mesh", "sequence": {"pattern": ")" + folder.path().string() +
                     R"(/b_{:02}.obj", "first": 1, "last": 2, "fps": 4, "units": 0.1}})"));
  Positions x;
  world->mesh_colliders.at(0).positions_at(0.125, x);
  EXPECT_NEAR(x(0, 1), 0.15, 1e-15);
}

TEST(Bodies, Avatars) {
  const std::filesystem::path path =
      std::filesystem::path(PIECEWORK_SHARED_DATA) / "avatars" / "RiggedSimple.glb";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path.string() << " is absent";
  const auto world =
      build_world(with_colliders(R"({"name": "figure", "shape": "mesh", "avatar": {"file": ")" +
                                 path.string() + R"(", "lead_in": 1, "units": 0.1}})"));
  const colliders::MeshCollider& figure = world->mesh_colliders.at(0);
  EXPECT_EQ(figure.num_vertices(), 96);
  EXPECT_FALSE(figure.is_static());
  EXPECT_TRUE(mentions(*world, "collider figure: 188 triangles"));
}

TEST(Bodies, RefusalsSayWhereAndWhatToDo) {
  const auto refused = [](const std::string& collider) {
    return refusal(with_colliders(collider));
  };
  EXPECT_NE(refused(R"({"shape": "half_spaces", "planes": [{"normal": [0, 1, 0]},
                        {"normal": [0, -1, 0], "point": [0, 1, 0]}]})")
                .find("t.json: /colliders/0: half_spaces: no point lies below all 2 planes"),
            std::string::npos);
  EXPECT_NE(refused(R"({"name": "w", "shape": "half_spaces", "surface": "triangles",
                        "planes": [{"normal": [0, 1, 0]}, {"normal": [1, 0, 0]}]})")
                .find("t.json: /colliders/0: w: its planes leave a side open, which no triangles "
                      "close; add planes, or leave out \"surface\""),
            std::string::npos);
  EXPECT_NE(refused(R"({"name": "b", "shape": "box", "rounding": 0.75, "surface": "triangles"})")
                .find("t.json: /colliders/0: b: rounding is 0.75 m"),
            std::string::npos);
  EXPECT_NE(refused(R"({"name": "b", "shape": "box", "rounding": 0.75})")
                .find("t.json: /colliders/0: b: rounding is 0.75 m"),
            std::string::npos);
  EXPECT_NE(refused(R"({"shape": "mesh", "avatar": {"file": "/nowhere/a.glb"}})")
                .find("t.json: /colliders/0/avatar/file: /nowhere/a.glb: file not found; correct "
                      "the path, or name another: --set /colliders/0/avatar/file="),
            std::string::npos);
  EXPECT_NE(refused(R"({"shape": "mesh", "sequence": {"pattern": "/nowhere/a.obj", "last": 3}})")
                .find("no single place for the number"),
            std::string::npos);
}

TEST(Bodies, CheckpointsKnowTheMeshes) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "b.obj";
  const auto hash = [&](const char* height) {
    write_file_atomically(file, std::string("v 0 ") + height + " 0\nv 0 0 1\nv 1 0 0\nf 1 2 3\n");
    return motion_hash(*build_world(
        with_colliders(R"({"shape": "mesh", "mesh": {"file": ")" + file.string() + R"("}})")));
  };
  const std::string low = hash("0");
  EXPECT_NE(low, hash("1"));
  EXPECT_EQ(low, hash("0"));
}

}  // namespace
}  // namespace piecework::runner
