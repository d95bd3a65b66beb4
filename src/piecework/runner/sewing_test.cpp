#include <piecework/runner/sewing.hpp>

#include <filesystem>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/runner/checkpoint.hpp>
#include <piecework/runner/expectation.hpp>
#include <piecework/runner/run.hpp>
#include <piecework/scene/scene_io.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

/// Two sheets of 4 x 5 and 4 x 9 vertices side by side, `gap` apart, with the given seams.
scene::Scene two_panels(const std::string& seams, double gap = 0,
                        const std::vector<scene::Override>& overrides = {}) {
  return scene::parse_scene(fmt::format(R"({{
    "name": "panels", "step": {{"h": 0.01, "steps": 12}}, "solver": {{"domains": 3}},
    "quality": {{"stop": "iterations", "max_iterations": 10}},
    "materials": {{"m": {{"density": 0.3, "stretching": 200}}}},
    "cloths": [
      {{"name": "left", "material": "m",
        "mesh": {{"generator": "sheet", "columns": 4, "rows": 5}},
        "pins": [{{"region": {{"vertices": [0]}}}}]}},
      {{"name": "right", "material": "m", "translate": [{}, 0, 0],
        "mesh": {{"generator": "sheet", "columns": 4, "rows": 9}}}}],
    "seams": [{}]}})",
                                        1 + gap, seams),
                            "panels.json", overrides);
}

constexpr const char* kBySet =
    R"({"cloth": "left", "set": "right", "to": "right", "to_set": "left")";

std::string by_set(const std::string& more = "") { return kBySet + more + "}"; }

using runner::refusal;  // beside the one below

std::string refusal(const std::string& seams, double gap = 0) {
  try {
    return refusal(two_panels(seams, gap));
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(SewingScene, EveryWayOfSayingItGivesTheSameSeam) {
  const auto reference = build_world(two_panels(by_set()));
  const mesh::SeamMap& expected = reference->model.sewing.map();
  ASSERT_EQ(expected.num_slaves(), 9);
  for (const int slave : expected.slaves) EXPECT_GE(slave, 20) << "the finer side follows";
  for (
      const std::string seams :
      {R"({"cloth": "right", "to": "left", "distance": 1e-3})",
       R"({"cloth": "left", "to": "right", "distance": 1e-3})",
       R"({"cloth": "right", "to": "left", "chain": [32, 28, 24, 20, 16, 12, 8, 4, 0], "to_chain": [19, 15, 11, 7, 3]})",
       R"({"cloth": "right", "to": "left", "stitches": [[0, 3, 7, 0], [4, 3, 7, 0.5], [8, 7, 11, 0],
            [12, 11, 7, 0.5], [16, 11, 15, 0], [20, 11, 15, 0.5], [24, 15, 19, 0], [28, 15, 19, 0.5],
            [32, 15, 19, 1]]})"}) {
    SCOPED_TRACE(seams);
    const auto world = build_world(two_panels(seams));
    const mesh::SeamMap& found = world->model.sewing.map();
    EXPECT_EQ(found.slaves, expected.slaves);
    EXPECT_EQ(found.carrier, expected.carrier);
    ASSERT_EQ(found.weight.size(), expected.weight.size());
    for (std::size_t k = 0; k < found.weight.size(); ++k)
      EXPECT_NEAR(found.weight[k], expected.weight[k], 1e-12);
  }
}

TEST(SewingScene, AbsentIsOff) {
  const auto world = build_world(two_panels(""));
  EXPECT_TRUE(world->model.sewing.empty());
  EXPECT_TRUE(world->model.sewing.map().row.empty());
  EXPECT_TRUE(world->seam_neighbors.empty());
  EXPECT_EQ(world->elements().seams, nullptr);
}

TEST(SewingScene, OneComponentForTheDomains) {
  const auto sewn = build_world(two_panels(by_set(), 0, {{"solver.domains", "1"}}));
  EXPECT_TRUE(sewn->notes.empty());
  const auto apart = build_world(two_panels("", 0, {{"solver.domains", "1"}}));
  EXPECT_EQ(apart->notes.size(), 1U) << "two components in one domain";
}

TEST(SewingScene, ReversedMeetsLastWithFirst) {
  const auto world = build_world(two_panels(by_set(R"(, "reversed": true, "close_time": 1)")));
  const mesh::SeamMap& map = world->model.sewing.map();
  ASSERT_EQ(map.num_slaves(), 9);
  EXPECT_EQ(map.slaves[0], 20);
  EXPECT_EQ(map.carrier[0], 19);
}

TEST(SewingScene, LongerSideIsGathered) {
  // A border twice as long still meets end to end.
  const auto world =
      build_world(two_panels(by_set(R"(, "close_time": 1)"), 0, {{"cloths.1.mesh.height", "2"}}));
  const mesh::SeamMap& map = world->model.sewing.map();
  EXPECT_EQ(map.num_slaves(), 9);
  EXPECT_NEAR(map.weight[1], 0.5, 1e-12) << "gathered: half way is half way";
}

TEST(SewingScene, RefusalsSayWhatToChange) {
  const auto expect = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  const std::string twice = by_set() + R"(, {"cloth": "right", "to": "left", "name": "hem",
      "stitches": [[4, 0, 1, 0.5]]})";
  expect(refusal(twice), "panels.json: /seams/1 (hem): vertex 4 of right is sewn onto two edges, ");
  expect(refusal(twice), "(by panels.json: /seams/0)");
  expect(refusal(R"({"cloth": "left", "to": "right", "stitches": [[3, 0, 4, 0.5]]},
                    {"cloth": "right", "to": "left", "stitches": [[4, 3, 7, 0.5]]})"),
         "vertex 4 of right hangs on itself");
  expect(refusal(by_set(), 0.3), "/seams/0: vertex 0 of right starts 0.3 m from its place");
  expect(refusal(by_set(), 0.3), "give the seam a close_time");
  EXPECT_EQ(refusal(by_set(R"(, "close_time": 0.1)"), 0.3), "");
  expect(refusal(R"({"cloth": "left", "to": "right", "stitches": [[99, 0, 1, 0]]})"),
         "/seams/0/stitches/0: vertex 99 does not exist; the mesh has vertices 0 to 19");
  expect(refusal(R"({"cloth": "left", "to": "right", "chain": [3, 11], "to_chain": [0, 4]})"),
         "vertex 3 of left and vertex 11 of left follow each other in a chain, but no edge joins");
  expect(refusal(R"({"cloth": "left", "set": "rigth", "to": "right", "to_set": "left"})"),
         "/seams/0/set: the mesh has no vertex set \"rigth\"; it has: border, bottom");
  expect(refusal(R"({"cloth": "left", "set": "border", "to": "right", "to_set": "left"})"),
         "is no single path along a border");
  expect(refusal(R"({"cloth": "left", "to": "right", "distance": 0.01})", 0.3),
         "no border vertex lies within 0.01 m");
  expect(refusal(R"({"cloth": "left", "distance": 0.4})"), "no border vertex lies within 0.4 m");
}

TEST(SewingScene, RulesBetweenKeys) {
  const auto expect = [](const std::string& seams, const char* part) {
    EXPECT_NE(refusal(seams).find(part), std::string::npos) << refusal(seams);
  };
  expect(R"({"cloth": "left"})", "neither \"stitches\" nor \"chain\"");
  expect(R"({"cloth": "left", "set": "right", "distance": 1})", "exclude each other");
  expect(R"({"set": "right", "to_set": "left"})", "does not say which of the 2 cloths");
  expect(R"({"cloth": "lift", "set": "right", "to_set": "left"})", "no cloth is named \"lift\"");
  expect(R"({"cloth": "left", "set": "right"})", "\"set\" without a \"to_set\"");
  expect(R"({"cloth": "left", "chain": [0, 1]})", "\"chain\" without a \"to_chain\"");
  expect(R"({"cloth": "left", "to": "right", "file": "x.json"})", "a file sews a cloth to itself");
  expect(R"({"cloth": "left", "stitches": [[0.5, 1, 2, 0]]})", "0.5 is no vertex number");
  expect(R"({"cloth": "left", "stitches": [[0, 1, 2, 3]]})", "the ratio 3 is above 1");
  expect(R"({"cloth": "left", "set": "left", "to_set": "right", "close_time": 0})", "close_time");
}

TEST(SewingScene, PinsOnTheSeam) {
  const auto world = build_world(
      two_panels(by_set(), 0, {{"cloths.1.pins", R"([{"region": {"vertices": [4]}}])"}}));
  EXPECT_EQ(world->pins.at(1).vertices, (std::vector<int>{3, 7}));
  const std::string text = refusal(
      two_panels(by_set(), 0,
                 {{"cloths.1.pins", R"([{"region": {"vertices": [4]}}])"},
                  {"cloths.0.pins", R"([{"region": {"vertices": [7]}, "velocity": [1, 0, 0]}])"}}));
  EXPECT_NE(text.find("/cloths/1/pins/0: holds vertex 4 of right, which is sewn onto vertex 7 of "
                      "left; that is held by panels.json: /cloths/0/pins/0"),
            std::string::npos)
      << text;
}

TEST(SewingScene, CollapsedTrianglesAreNoted) {
  const auto world =
      build_world(two_panels(R"({"cloth": "left", "stitches": [[0, 1, 2, 0]], "close_time": 1})"));
  ASSERT_EQ(world->notes.size(), 1U);
  EXPECT_EQ(
      world->notes[0],
      "seams sew two corners of one triangle to each other, 1 times; the first is vertex 0 of "
      "left, vertex 5 of left, vertex 1 of left: these triangles have no area");
}

TEST(SewingScene, HashesKnowTheSeams) {
  const auto world = [](const std::string& seams) { return build_world(two_panels(seams)); };
  EXPECT_NE(motion_hash(*world("")), motion_hash(*world(by_set())));
  EXPECT_NE(motion_hash(*world(by_set())), motion_hash(*world(by_set(R"(, "close_time": 1)"))));
}

/// Keeps the last state.
struct Watcher : RunObserver {
  Positions x;
  void started(const World&, int, int) override {}
  void frame_done(const World&, const model::State& state, int, const FrameRecord*) override {
    x = state.x;
  }
  bool should_stop() override { return stop_at > 0 && ++frames >= stop_at; }
  int frames = 0;
  int stop_at = 0;
};

TEST(SewingScene, ClosesWhileARunIsInterruptedAndResumed) {
  const TemporaryFolder folder;
  const scene::Scene scene = two_panels(by_set(R"(, "close_time": 0.08)"), 0.3, {{"expect", R"([
      {"quantity": "sewn_vertices", "min": 9, "max": 9},
      {"quantity": "sewn_vertices", "cloth": "left", "max": 0},
      {"quantity": "seam_gap", "at": 0, "min": 0.299, "max": 0.301},
      {"quantity": "seam_gap", "at": 0.04, "min": 0.149, "max": 0.151},
      {"quantity": "seam_gap", "max": 1e-14}])"}});
  RunOptions options{.directory = folder.path() / "whole"};
  Watcher whole;
  const RunOutcome outcome = run(scene, options, whole);
  for (const ExpectationResult& e : outcome.record.expectations)
    EXPECT_TRUE(e.holds) << e.text << " " << e.value;
  options.directory = folder.path() / "parts";
  Watcher part;
  part.stop_at = 5;
  EXPECT_TRUE(run(scene, options, part).stopped);
  Watcher rest;
  run(scene, options, rest);
  EXPECT_TRUE(rest.x == whole.x) << "the same bits";
  EXPECT_NE(read_file(options.directory / "run.json").find("\"sewn_vertices\": 9"),
            std::string::npos);
  EXPECT_NE(read_file(options.directory / "summary.md").find("Seams: 9 of 56 vertices"),
            std::string::npos);
}

// Multipliers on seams change how a step is solved, not what it gives.
TEST(SewingScene, MultipliersMoveItAsEliminationDoes) {
  const auto last = [](const char* form, const std::string& seams, double gap,
                       std::vector<scene::Override> overrides) {
    const TemporaryFolder folder;
    overrides.insert(overrides.end(), {{"solver.global", "primal_dual"}, {"solver.seams", form}});
    Watcher watcher;
    run(two_panels(seams, gap, overrides), {.directory = folder.path()}, watcher);
    return watcher.x;
  };
  const auto expect_same = [&](const std::string& seams, double gap,
                               const std::vector<scene::Override>& overrides) {
    const Positions elimination = last("elimination", seams, gap, overrides);
    const Positions dual = last("dual", seams, gap, overrides);
    ASSERT_EQ(dual.rows(), 56);
    EXPECT_GT((dual - build_world(two_panels(seams, gap))->model.start).norm(), 0.1) << "it moves";
    EXPECT_LT((dual - elimination).cwiseAbs().maxCoeff(), 1e-9);
  };
  expect_same(by_set(), 0, {});
  expect_same(by_set(), 0, {{"solver.domains", "1"}, {"materials.m.bending", "1e-3"}});
  expect_same(by_set(), 0, {{"solver.domains", "12"}, {"solver.corner_fraction", "0"}});
  expect_same(by_set(R"(, "close_time": 0.08)"), 0.3, {});
  // A pin on a slave, let go in the middle: other slaves and unknowns from then on.
  expect_same(by_set(), 0,
              {{"cloths.1.pins", R"([{"region": {"vertices": [4]}, "release": 0.06}])"}});
}

TEST(SewingScene, ReactionOfPinsCarriesBothPanels) {
  const TemporaryFolder folder;
  // Held along the seam, both panels at rest in the end: the pins carry their weight.
  const scene::Scene scene =
      two_panels(by_set(), 0,
                 {{"cloths.0.pins", R"([{"region": {"sets": ["right"]}}])"},
                  {"damping", "8"},
                  {"step.steps", "400"},
                  {"expect", R"([{"quantity": "reaction_force_y", "min": 5.8, "max": 5.97}])"}});
  Watcher watcher;
  const RunOutcome outcome = run(scene, {.directory = folder.path()}, watcher);
  EXPECT_TRUE(outcome.expectations_hold()) << outcome.record.expectations[0].value;
}

// Patterns of our test data: every seam of every file, at the numbers of the file.
TEST(SewingScene, GarmentPatternsOfTheSharedData) {
  const std::string folder = std::string(PIECEWORK_SHARED_DATA) + "/garments/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no shared data here";
  for (const char* name :
       {"gc_shirt_8panel", "gc_hoody_6panel", "gc_pencil_dress_6panel", "gp_dress_8panel",
        "gp_dress_8panel_conforming", "gp_pants_4panel", "gp_skirt_8panel", "cipc_dress_14panel"}) {
    SCOPED_TRACE(name);
    const auto world = build_world(scene::parse_scene(fmt::format(R"({{"materials": {{"m": {{}}}},
          "cloths": [{{"material": "m", "mesh": {{"file": "{0}{1}.obj"}}}}],
          "seams": [{{"file": "{0}{1}.seams.json", "close_time": 1}}]}})",
                                                                  folder, name),
                                                      "garment.json"));
    const mesh::SeamMap& map = world->model.sewing.map();
    EXPECT_GT(map.num_slaves(), 50);
    EXPECT_TRUE(world->domains.notes.empty()) << "all panels in one piece";
    EXPECT_EQ(world->domains.num_domains, 32);
  }
}

}  // namespace
}  // namespace piecework::runner
