// Contact in very short and very long steps.

#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <piecework/scene/scene_io.hpp>

#include "course_test_util.hpp"

namespace piecework::runner {
namespace {

/// A sheet of side 0.3 m falls for 4 mm onto a floor, with or without a ball in between.
scene::Scene falling(double h, const std::string& more) {
  return scene::parse_scene(fmt::format(R"({{"name": "f", "step": {{"h": {}}},
      "solver": {{"domains": 2}}, "self_collision": true, "friction": 0.3,
      "materials": {{"m": {{"stretching": 261, "bending": 1e-5}}}},
      "cloths": [{{"material": "m", "translate": [-0.15, 0.004, -0.15],
        "mesh": {{"generator": "sheet", "width": 0.3, "height": 0.3, "columns": 10, "rows": 10}}}}],
      "colliders": [{{"name": "floor", "shape": "plane"}}{}]}})",
                                        h, more),
                            "f.json");
}

struct TimeStep {
  const char* name;
  double h;
  int steps;
  double speed;   ///< of the ball, m/s; it rises by 9 cm
  double lifted;  ///< how high the middle of the sheet is at least, m; in long steps the ball lags
};

class TimeSteps : public ::testing::TestWithParam<TimeStep> {};

TEST_P(TimeSteps, ASheetComesToRestOnTheFloor) {
  const auto world = build_world(falling(GetParam().h, ""));
  const Course course = run(*world, GetParam().steps);
  EXPECT_EQ(course.converged, GetParam().steps);
  EXPECT_EQ(course.interpenetrations, 0);
  EXPECT_GE(course.most_pairs, 10 * 10) << "all of it lies";
  EXPECT_GT(course.end.x.col(1).minCoeff(), 0);
  EXPECT_LT(course.end.x.col(1).maxCoeff(), contact_distance(*world));
  EXPECT_LT(course.end.v.cwiseAbs().maxCoeff(), 0.02);
}

TEST_P(TimeSteps, ASheetIsLiftedByABallOfTriangles) {
  const auto& [name, h, steps, speed, lifted] = GetParam();
  const auto world =
      build_world(falling(h, fmt::format(R"(, {{"name": "ball", "shape": "sphere", "radius": 0.05,
             "center": [0, -0.051, 0], "surface": "triangles", "segments": 3,
             "motion": {{"velocity": [0, {}, 0], "stop": {}}}}})",
                                         speed, 0.09 / speed)));
  const Course course = run(*world, steps);
  EXPECT_EQ(course.converged, steps);
  EXPECT_EQ(course.interpenetrations, 0);
  EXPECT_GT(course.most_pairs, 10);
  EXPECT_GT(course.end.x.col(1).maxCoeff(), lifted);
}

INSTANTIATE_TEST_SUITE_P(All, TimeSteps,
                         ::testing::Values(TimeStep{"short", 1.0 / 2000, 250, 1, 0.088},
                                           TimeStep{"long", 1.0 / 10, 14, 0.1, 0.03}),
                         [](const auto& step) { return std::string(step.param.name); });

}  // namespace
}  // namespace piecework::runner
