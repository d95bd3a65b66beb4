#include <piecework/runner/start.hpp>

#include <algorithm>

#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/runner/checkpoint.hpp>
#include <piecework/runner/methods.hpp>
#include <piecework/runner/run.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

/// A sheet, its middle at the height `y` of a ball's top minus 1 m.
scene::Scene sheet_over_ball(const std::string& y, const std::string& untangle = "100",
                             const std::string& pins = "[]") {
  return scene::parse_scene(
      R"({"name": "t", "step": {"steps": 4}, "solver": {"domains": 4},
          "contact": {"distance": 0.005, "untangle": )" +
          untangle + R"(}, "materials": {"m": {"stretching": 100}},
          "cloths": [{"name": "rag", "material": "m", "translate": [-0.5, )" +
          y + R"(, -0.5], "pins": )" + pins +
          R"(, "mesh": {"generator": "sheet", "columns": 15, "rows": 15}}],
          "colliders": [{"name": "ball", "shape": "mesh",
                         "mesh": {"generator": "icosphere", "radius": 0.4, "rows": 6}}]})",
      "t.json");
}

bool mentions(const World& world, const std::string& text) {
  return std::any_of(world.notes.begin(), world.notes.end(),
                     [&](const std::string& note) { return note.find(text) != std::string::npos; });
}

class Quiet final : public RunObserver {
 public:
  void started(const World&, int, int) override {}
  void frame_done(const World&, const model::State&, int, const FrameRecord*) override {}
  bool should_stop() override { return false; }
};

TEST(Start, IsUntangledAndTheRestShapeStays) {
  const auto world = build_world(sheet_over_ball("0.3"));
  ASSERT_TRUE(world->untangling);
  EXPECT_GT(world->untangling->before.edges, 0);
  EXPECT_GT(world->untangling->before.inside, 0);
  EXPECT_EQ(world->untangling->after.total(), 0);
  EXPECT_TRUE(mentions(*world, "vertices inside of bodies; untangled in "));
  EXPECT_EQ(world->model.start.col(1).maxCoeff(), 0.3);
  const auto integrator = make_integrator(*world);
  model::State state = start_state(*world, *integrator);
  EXPECT_GT(state.x.col(1).maxCoeff(), 0.39);
  const model::StepReport report = integrator->step(state);
  ASSERT_TRUE(report.contact);
  EXPECT_EQ(report.contact->interpenetrations, 0);
}

TEST(Start, CleanOnesAndThoseSwitchedOffStayAsTheyAre) {
  const auto clean = build_world(sheet_over_ball("0.5"));
  const auto off = build_world(sheet_over_ball("0.3", "0"));
  for (const World* world : {clean.get(), off.get()}) {
    EXPECT_FALSE(world->untangling);
    const auto integrator = make_integrator(*world);
    EXPECT_TRUE(start_state(*world, *integrator).x == world->model.start);
  }
  EXPECT_FALSE(mentions(*clean, "start: "));
  EXPECT_TRUE(mentions(*off, "start: "));
  EXPECT_TRUE(mentions(*off, "switch /contact/untangle on"));
}

TEST(Start, WhatIsLeftIsNamed) {
  const auto world =
      build_world(sheet_over_ball("0.3", "20", R"([{"region": {"vertices": [112]}}])"));
  ASSERT_TRUE(world->untangling);
  EXPECT_GT(world->untangling->after.total(), 0);
  EXPECT_TRUE(mentions(*world, "are left, the first at vertex "));
}

TEST(Start, IsFrameZeroAndContinuedRunsHaveTheSameBits) {
  const TemporaryFolder folder;
  const scene::Scene scene = sheet_over_ball("0.3");
  Quiet quiet;
  RunOptions whole{.directory = folder.path() / "whole"};
  const RunOutcome outcome = run(scene, whole, quiet);
  RunOptions parts{.directory = folder.path() / "parts", .frames = 2};
  run(scene, parts, quiet);
  parts.frames = -1;
  parts.resume = true;
  run(scene, parts, quiet);

  for (const int frame : {0, 2, 4})
    EXPECT_EQ(read_file(state_file(whole.directory, frame)),
              read_file(state_file(parts.directory, frame)))
        << frame;
  EXPECT_EQ(read_file(whole.directory / "checkpoint.bin"),
            read_file(parts.directory / "checkpoint.bin"));
  EXPECT_NE(read_file(whole.directory / "run.json").find("\"untangling\""), std::string::npos);
  const int vertices = outcome.world->model.num_vertices();
  const model::State start =
      read_state(state_file(whole.directory, 0), motion_hash(*outcome.world), vertices);
  EXPECT_TRUE(start.x == outcome.world->untangled);
}

}  // namespace
}  // namespace piecework::runner
