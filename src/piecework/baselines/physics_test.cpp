// Whole simulations against physics: momentum, reaction force, refinement, order of the time step.

#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include <gtest/gtest.h>

#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/core/error.hpp>
#include <piecework/model/integrator.hpp>
#include <piecework/model/measures.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::baselines {
namespace {

using model::StopRule;

constexpr double kGravity = 9.81;

struct Simulation {
  model::ClothModel model;
  std::unique_ptr<model::Integrator> integrator;
  model::State state;

  Simulation(const mesh::TriangleMesh& mesh, const model::Material& material,
             model::ExternalForces forces, std::vector<model::Pin> pins, double h,
             model::StopOptions stop, std::optional<double> damping = {})
      : model(testing::cloth_model(mesh, material)) {
    integrator = std::make_unique<model::Integrator>(
        model, std::move(forces), std::move(pins), model::IntegratorOptions{h, damping},
        std::make_unique<VanillaPd>(model, h, kGravity, stop));
    state = integrator->initial_state({});
  }
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  void advance(int steps) {
    for (int i = 0; i < steps; ++i) integrator->step(state);
  }
};

const model::ExternalForces kFalling{.gravity = Vec3(0, -kGravity, 0)};
const model::StopOptions kTight{StopRule::Gradient, 1e-9, 20000, 1};

TEST(Physics, FreeSheetKeepsItsMomentumAndLosesEnergy) {
  Simulation run(testing::grid_mesh(8, 8), testing::cotton(1e-3), {}, {}, 1.0 / 120.0, kTight);
  run.state.v = testing::random_positions(64, 1.0, 4);
  const Vec3 momentum = model::linear_momentum(run.model, run.state.v);
  const double energy = model::kinetic_energy(run.model, run.state.v);
  ASSERT_GT(momentum.norm(), 1e-3);
  run.advance(20);
  EXPECT_LT((model::linear_momentum(run.model, run.state.v) - momentum).norm(), 1e-9);
  EXPECT_LT(model::kinetic_energy(run.model, run.state.v), energy) << "implicit Euler dissipates";
}

TEST(Physics, FreeFallIsExactForImplicitEuler) {
  const double h = 1.0 / 60.0;
  Simulation run(testing::grid_mesh(5, 5), testing::cotton(), kFalling, {}, h, kTight);
  run.advance(30);
  // y_n = -g h^2 n (n + 1) / 2
  const double expected = -kGravity * h * h * 30 * 31 / 2;
  EXPECT_LT((run.state.x.col(1).array() - expected).abs().maxCoeff(), 1e-9);
}

// At rest the pins carry the sheet's weight: the elastic force on them is m g.
TEST(Physics, HangingSheetPullsWithItsWeight) {
  std::vector<int> top;
  for (int i = 0; i < 9; ++i) top.push_back(i);
  auto mesh = testing::grid_mesh(9, 9, 0.5);
  Simulation run(mesh, {.density = 0.5, .stretching = 100, .bending = 1e-3}, kFalling,
                 {{.vertices = top}}, 1.0 / 30.0, {StopRule::Gradient, 1e-10, 20000, 1}, 4.0);
  run.advance(400);
  ASSERT_LT(run.state.v.norm(), 1e-6) << "not at rest yet";
  local::JacobiStep local(run.model, 1.0 / 30.0);
  const std::vector<char> free(81, 0);
  Positions gradient;
  local.evaluate(run.state.x, {&run.state.x, &free, &run.state.x},
                 gradient);  // z = x: elastic part only
  double reaction = 0;
  double pinned_weight = 0;
  for (const int v : top) {
    reaction += -gradient(v, 1);
    pinned_weight += run.model.mass[v] * kGravity;
  }
  const double weight = run.model.mass.sum() * kGravity;
  EXPECT_NEAR(-reaction + pinned_weight, weight, 1e-5 * weight);
  EXPECT_LT(run.state.x.col(1).minCoeff(), -0.4) << "it hangs";
}

// A strip hung by its top edge stretches by rho g L^2 / (2 k_s) at its lower end (linear, nu = 0).
TEST(Physics, HangingStripConvergesUnderRefinement) {
  const double length = 1.0;
  const double stretching = 200;
  const double expected = 0.5 * kGravity * length * length / (2 * stretching);
  std::vector<double> errors;
  for (const int cells : {4, 8, 16}) {
    auto mesh = testing::grid_mesh(cells / 2 + 1, cells + 1, length);
    mesh.positions.col(0) *= 0.5;
    mesh.positions.col(1) = -mesh.positions.col(2);  // hanging from the start
    mesh.positions.col(2).setZero();
    std::vector<int> top;
    for (int i = 0; i <= cells / 2; ++i) top.push_back(i);
    Simulation run(mesh, {.density = 0.5, .stretching = stretching, .bending = {}}, kFalling,
                   {{.vertices = top}}, 0.1, {StopRule::Gradient, 1e-9, 50000, 1}, 3.0);
    run.advance(150);
    ASSERT_LT(run.state.v.norm(), 1e-5);
    const double stretch = -run.state.x.col(1).minCoeff() - length;
    errors.push_back(std::abs(stretch - expected));
  }
  EXPECT_LT(errors[2], 0.01 * expected);
  EXPECT_LT(errors[2], 0.7 * errors[0] + 1e-12);
}

// Halving h halves the error: implicit Euler is of first order.
TEST(Physics, TimeStepIsOfFirstOrder) {
  const auto swing = [](double h) {
    std::vector<int> left;
    for (int i = 0; i < 5; ++i) left.push_back(5 * i);
    Simulation run(testing::grid_mesh(5, 5, 0.5),
                   {.density = 0.5, .stretching = 50, .bending = 2e-2}, kFalling,
                   {{.vertices = left}}, h, {StopRule::Gradient, 1e-9, 20000, 1});
    run.advance(static_cast<int>(std::lround(0.2 / h)));
    return run.state.x;
  };
  const Positions reference = swing(0.2 / 1280);
  const double coarse = (swing(0.2 / 20) - reference).norm();
  const double middle = (swing(0.2 / 40) - reference).norm();
  const double fine = (swing(0.2 / 80) - reference).norm();
  ASSERT_GT(coarse, 1e-4);
  EXPECT_NEAR(std::log2(coarse / middle), 1.0, 0.3);
  EXPECT_NEAR(std::log2(middle / fine), 1.0, 0.3);
}

TEST(Physics, DampingSlowsAFreeSheetExponentially) {
  const double h = 0.01;
  Simulation run(testing::grid_mesh(4, 4), testing::cotton(), {}, {}, h, kTight, 2.0);
  run.state.v.rowwise() = Eigen::RowVector3d(1, 0, 0);
  run.advance(50);
  EXPECT_NEAR(run.state.v(5, 0), std::exp(-2.0 * 50 * h), 1e-9);
}

TEST(Physics, ReleasedPinsLetTheSheetFall) {
  Simulation run(testing::grid_mesh(5, 5), testing::cotton(), kFalling,
                 {{.vertices = {0, 4}, .release = 0.1}}, 0.02, {StopRule::Iterations, 0, 30, 1});
  run.advance(4);
  EXPECT_EQ(run.state.x(0, 1), 0.0);
  const auto report = run.integrator->step(run.state);  // t = 0.1: free
  EXPECT_GE(report.phases.refactor, 0);
  EXPECT_LT(run.state.x(0, 1), 0.0);
}

TEST(Physics, ScriptedPinsCarryTheSheet) {
  Simulation run(testing::grid_mesh(5, 5), testing::cotton(), {},
                 {{.vertices = {0, 4, 20, 24}, .velocity = Vec3(0, 1, 0)}}, 0.01, kTight);
  run.advance(100);
  EXPECT_NEAR(run.state.x(0, 1), 1.0, 1e-12);
  EXPECT_GT(run.state.x.col(1).minCoeff(), 0.7);
}

TEST(Physics, NonFiniteStatesAreRefusedAndTheStateKept) {
  model::ExternalForces absurd{.gravity = Vec3(0, -std::numeric_limits<double>::max(), 0)};
  Simulation run(testing::grid_mesh(4, 4), testing::cotton(), absurd, {}, 10.0, {});
  const Positions before = run.state.x;
  EXPECT_THROW(run.integrator->step(run.state), SimulationError);
  EXPECT_TRUE(run.state.x == before);
  EXPECT_EQ(run.state.step, 0);
}

TEST(Physics, PhasesAddUpToTheStep) {
  Simulation run(testing::grid_mesh(60, 60), testing::cotton(), kFalling, {{.vertices = {0, 59}}},
                 1.0 / 120.0, {StopRule::Iterations, 0, 20, 1});
  run.advance(1);
  int within = 0;
  for (int i = 0; i < 10; ++i) {
    const auto report = run.integrator->step(run.state);
    const auto& p = report.phases;
    const double sum = p.local + p.global + p.misc + std::max(0.0, p.refactor);
    EXPECT_LE(sum, report.step_ms * (1 + 1e-9));
    within += sum > 0.95 * report.step_ms;
  }
  EXPECT_GE(within, 8) << "the phases leave more than 5 % of a step unexplained";
}

}  // namespace
}  // namespace piecework::baselines
