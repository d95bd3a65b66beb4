#include "step_records.hpp"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <piecework/runner/methods.hpp>

#include "contact_scenes.hpp"
#include "power_law.hpp"

namespace piecework::bench {
namespace {

StepRecord record(int step, double ms, int pairs) {
  StepRecord result{.step = step, .cpu_ms = ms + 1};
  result.report.step_ms = ms;
  result.report.iterations = 10 * step;
  result.report.global_solves = 3;
  result.report.converged = step != 2;
  result.report.phases.cull = ms / 10;
  result.report.phases.narrow = ms / 5;
  result.report.contact = model::ContactReport{.pairs = pairs};
  return result;
}

/// Times grow as the square of the pairs.
std::vector<StepRecord> three() { return {record(1, 4, 20), record(2, 1, 10), record(3, 16, 40)}; }

/// Of 0.05, 0.4 and 16/30 ms at 10, 20 and 40 pairs, evenly spaced in logarithms: half of the last
/// over the first.
const double kIterationGrowth = std::log((16.0 / 30) / 0.05) / std::log(4);

TEST(StepRecords, SummaryIsWhatOneCountsByHand) {
  auto records = three();
  records[0].true_error = 0.5;
  records[2].true_error = 0.1;
  const auto result = summary(records);
  const std::map<std::string, double> expected{{"steps", 3},
                                               {"step_ms", 4},
                                               {"step_ms_mean", 7},
                                               {"max_over_median", 3.4},
                                               {"cpu_ms", 5},
                                               {"cpu_ms_mean", 8},
                                               {"iterations", 20},
                                               {"iterations_mean", 20},
                                               {"iterations_max", 30},
                                               {"solves", 3},
                                               {"cull_share", 0.1},
                                               {"narrow_share", 0.2},
                                               {"check_share", 0},
                                               {"pairs", 20},
                                               {"pairs_max", 40},
                                               {"converged", 2.0 / 3},
                                               {"interpenetrations", 0},
                                               {"growth_by_pairs", 2},
                                               {"iteration_growth_by_pairs", kIterationGrowth},
                                               {"true_errors", 2},
                                               {"true_error", 0.3},
                                               {"true_error_max", 0.5}};
  for (const auto& [name, value] : expected) EXPECT_NEAR(result.at(name), value, 1e-9) << name;
  EXPECT_EQ(result.size(), expected.size());
}

TEST(StepRecords, WithoutJudgedStepsThereIsNoTrueError) {
  EXPECT_FALSE(summary(three()).contains("true_error"));
}

TEST(StepRecords, PairsThatHardlyVaryShowNoGrowth) {
  EXPECT_FALSE(
      summary({record(1, 1, 10), record(2, 2, 0), record(3, 4, 20)}).contains("growth_by_pairs"));
}

TEST(StepRecords, DefectsAreNamed) {
  auto records = three();
  EXPECT_EQ(defect(records), "");
  records[1].report.contact->interpenetrations = 2;
  records[2].report.contact->interpenetrations = 3;
  EXPECT_EQ(defect(records), "5 interpenetrations");
  EXPECT_EQ(defect({record(1, 1, 0)}), "nothing touched");
}

TEST(StepRecords, JsonHasAPointPerStep) {
  auto records = three();
  records.pop_back();
  records[1].true_error = 0.25;
  EXPECT_EQ(records_json({{"drape", "ball", "1e-2", 9, 2, records}}),
            R"({"schema": "piecework.step_records/1", "columns": ["step", "step_ms", "cpu_ms", )"
            R"("cull_ms", "narrow_ms", "iterations", "pairs", "true_error"], "runs": [)"
            "\n"
            R"({"family": "drape", "scene": "ball", "n": 9, "tolerance": "1e-2", "threads": 2, )"
            R"("points": [[1, 4, 5, 0.4, 0.8, 10, 20, null], [2, 1, 2, 0.1, 0.2, 20, 10, 0.25]]}]})"
            "\n");
}

/// An integrator of a small scene of contact_scenes.hpp.
struct Small {
  std::unique_ptr<runner::World> world;
  std::unique_ptr<model::Integrator> integrator;

  explicit Small(double tolerance) {
    scene::Scene scene = support_scene(Support::Rigid, 6, kSticks);
    scene.quality.tolerance = tolerance;
    scene.quality.max_iterations = 50;
    world = runner::build_world(scene);
    integrator = runner::make_integrator(*world);
  }
};

TEST(StepRecords, DistanceFromExactIsTheLargestOfAnyVertex) {
  const Small small(1e-3), exact(1e-3);
  model::State state = small.integrator->initial_state(small.world->part_velocity);
  const model::State before = state;
  const StepRecord record = take_step(*small.integrator, state);
  EXPECT_EQ(record.step, 1);
  EXPECT_EQ(distance_from_exact(*exact.integrator, before, state.x, 1e-2), 0);
  state.x.row(3) += Eigen::RowVector3d(3e-3, 0, -4e-3);
  state.x.row(7) += Eigen::RowVector3d(0, 1e-3, 0);
  EXPECT_NEAR(distance_from_exact(*exact.integrator, before, state.x, 1e-2), 0.5, 1e-9);
}

TEST(StepRecords, WhatDoesNotConvergeIsNoMeasure) {
  const Small small(1e-300);
  const model::State state = small.integrator->initial_state(small.world->part_velocity);
  EXPECT_TRUE(std::isnan(distance_from_exact(*small.integrator, state, state.x, 1)));
}

TEST(PowerLaw, ExponentOfExactPowersAndOfNothing) {
  const std::vector<double> x{1, 2, 5, 0, 9},
      y{3, 3 * std::pow(2, 1.5), 3 * std::pow(5, 1.5), 7, 0};
  EXPECT_NEAR(power_exponent(x, y), 1.5, 1e-12) << "points without a logarithm do not count";
  const std::vector<double> same{4, 4}, other{1, 2};
  EXPECT_TRUE(std::isnan(power_exponent(same, other)));
  EXPECT_TRUE(std::isnan(power_exponent({}, {})));
}

}  // namespace
}  // namespace piecework::bench
