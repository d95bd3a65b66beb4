#include <piecework/runner/tune.hpp>

#include <cmath>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

TEST(Tune, MeasuresEveryCandidateAndLeavesTheWorldAsItWas) {
  const auto world = build_world(small_scene({{"solver.global", "primal_dual"}}));
  const scene::Scene scene = world->scene;
  const auto owner = world->domains.triangle_domain;
  const Measurements measured = measure_settings(*world, {{1, {}}, {4, {}}, {3, {1, 1, 0.5}}});
  EXPECT_EQ(measured.solvers, (std::vector<std::string>{"tree", "primal_dual"}));
  ASSERT_EQ(measured.rows.size(), 3U) << "the present setting is not measured twice";
  EXPECT_EQ(measured.rows[0].setting.domains, 4);
  for (const CandidateRow& row : measured.rows) {
    SCOPED_TRACE(row.setting.domains);
    EXPECT_EQ(row.refusal, "");
    ASSERT_EQ(row.timings.size(), 2U);
    for (const Timing& timing : row.timings) {
      EXPECT_GT(timing.ms.median, 0);
      EXPECT_LE(timing.ratio.low, timing.ratio.median);
      EXPECT_LE(timing.ratio.median, timing.ratio.high);
      EXPECT_TRUE(std::isfinite(timing.ratio.high));
    }
  }
  EXPECT_EQ(measured.rows[1].timings[0].ratio.count, static_cast<std::size_t>(kTunePairs));
  EXPECT_FALSE(measured.rows[0].timings[0].significant());
  EXPECT_EQ(world->scene, scene);
  EXPECT_EQ(world->domains.triangle_domain, owner);
}

TEST(Tune, SingleDoesNotKnowDomains) {
  const auto world = build_world(small_scene({{"solver.global", "single"}}));
  EXPECT_EQ(measure_settings(*world, {}).solvers, (std::vector<std::string>{"tree"}));
}

TEST(Tune, ASceneWithoutAFreeVertexIsRefused) {
  const auto world =
      build_world(small_scene({{"cloths.0.pins.0.region.box", "[[-9, -9, -9], [9, 9, 9]]"}}));
  EXPECT_THROW((void)measure_settings(*world, {}), InputError);
}

}  // namespace
}  // namespace piecework::runner
