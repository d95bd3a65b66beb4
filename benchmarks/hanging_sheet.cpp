#include "hanging_sheet.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <piecework/baselines/newton.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/runner/methods.hpp>

namespace piecework::bench {
namespace {

constexpr int kMostForNewton = 70000;  // vertices: beyond, its factor takes minutes

scene::Scene sheet_scene(const Cloth& cloth, int side, double h) {
  scene::Scene scene;
  scene.name = cloth.name;
  scene.step.h = h;
  scene.solver.domains = 32;
  scene.quality.stop = "gradient";
  scene.quality.tolerance = 1e-5;
  scene.quality.max_iterations = 1000;
  scene.materials["cloth"] = {.stretching = cloth.stretching, .bending = cloth.bending};
  scene::Cloth sheet{.material = "cloth"};
  sheet.mesh.generator = "sheet";
  sheet.mesh.pattern = "delaunay";
  sheet.mesh.columns = sheet.mesh.rows = side;
  sheet.pins = {{.region = {.vertices = {0, side - 1}}}};
  scene.cloths = {sheet};
  return scene;
}

double largest(const Positions& offset) { return offset.rowwise().norm().maxCoeff(); }

}  // namespace

HangingSheet::HangingSheet(const Cloth& cloth, int side, const Instant& instant)
    : world_(runner::build_world(sheet_scene(cloth, side, instant.h))) {
  const auto integrator = runner::make_integrator(*world_);
  model::State state = integrator->initial_state(world_->part_velocity);
  for (int i = 1; i < instant.step; ++i) (void)integrator->step(state);
  // The problem of the next step, seen from inside.
  previous_ = state.x;
  memory_ = state.memory;
  integrator->observe([&](const model::StepProblem& problem) {
    predicted_ = *problem.predicted;
    if (problem.extrapolated) extrapolated_ = *problem.extrapolated;
    fixed_ = *problem.fixed;
  });
  (void)integrator->step(state);
  solve(state.x);
}

void HangingSheet::solve(Positions x) {
  scene::Scene& scene = world_->scene;
  scene.quality.tolerance = 1e-14;  // until rounding ends it
  solution_ = std::move(x);
  model::StepReport report = runner::make_minimizer(*world_)->minimize(problem(), solution_);
  if (world_->model.num_vertices() <= kMostForNewton) {
    // No reference of ours alone: Newton's method shares nothing with the engine.
    const double ours = report.energy;
    baselines::Newton newton(world_->model, scene.step.h, 9.81,
                             {model::StopRule::Gradient, 1e-10, 6, 1},
                             {.hessian = model::HessianForm::Unprojected});
    report = newton.minimize(problem(), solution_);
    if (!(std::abs(report.energy - ours) <= 1e-10 * std::abs(ours)))
      throw std::runtime_error("hanging sheet: Newton's method finds another minimum");
  }
  minimum_ = report.energy;
  reference_gradient_ = report.gradient;
  motion_ = largest(solution_ - previous_);
  local::JacobiStep local(world_->model, scene.step.h);
  Positions gradient;
  start_energy_ = local.evaluate(predicted_, problem(), gradient).energy;
}

model::StepProblem HangingSheet::problem() const {
  return {.predicted = &predicted_,
          .fixed = &fixed_,
          .previous = &previous_,
          .extrapolated = extrapolated_.size() > 0 ? &extrapolated_ : nullptr};
}

double HangingSheet::position_error(const Positions& x) const {
  return std::sqrt(parallel_max(static_cast<std::size_t>(x.rows()),
                                [&](std::size_t v) {
                                  const auto row = static_cast<Eigen::Index>(v);
                                  return (x.row(row) - solution_.row(row)).squaredNorm();
                                })) /
         motion_;
}

}  // namespace piecework::bench
