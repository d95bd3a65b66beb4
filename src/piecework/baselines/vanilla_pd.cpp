#include <piecework/baselines/vanilla_pd.hpp>

#include <cmath>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::baselines {

using model::StepReport;

VanillaPd::VanillaPd(const model::ClothModel& model, double h, double gravity,
                     model::StopOptions stop, std::unique_ptr<global::ExactSolver> solver)
    : model_(model),
      convergence_(model, gravity, stop),
      K_(assemble_system(model, h)),
      solver_(std::move(solver)),
      local_(model, h) {
  convergence_.assume_stiffness_ratio(stiffness_ratio(model, K_, h));
}

std::string VanillaPd::description() const {
  return "vanilla PD, Jacobi local step, " + solver_->description();
}

void VanillaPd::prepare(const std::vector<char>& fixed) {
  fixed_ = fixed;
  reduction_ = model::Reduction(model_, fixed);
  increment_.resize(reduction_.count(), 3);
  const auto status = solver_->factor(reduction_.system(K_), reduction_.vertices());
  global::require_factor(status, reduction_.count());
}

model::SetupReport VanillaPd::setup_report() const {
  const global::FactorReport& report = solver_->report();
  return {report.analyze_ms + report.factor_ms, report.nonzeros, static_cast<double>(report.bytes)};
}

StepReport VanillaPd::minimize(const model::StepProblem& problem, Positions& x) {
  StepReport report;
  Stopwatch watch;
  if (fixed_ != *problem.fixed) {
    prepare(*problem.fixed);
    report.phases.refactor = watch.lap();
  }
  report.phases.local = 0;
  report.phases.global = 0;

  convergence_.begin();
  const auto evaluate = [&] {
    watch.lap();
    const auto result = local_.evaluate(x, problem, gradient_);
    report.energy = result.energy;
    report.degenerate_projections = result.degenerate;
    convergence_.measure_gradient(reduction_, gradient_, report);
    report.phases.local += watch.lap();
  };
  evaluate();
  bool go_on = problem.observe(report, x);
  while (go_on && report.iterations < convergence_.stop().max_iterations && !report.converged) {
    watch.lap();
    global_step(x, report);
    ++report.iterations;
    ++report.global_solves;
    report.phases.global += watch.lap();
    evaluate();
    go_on = problem.observe(report, x);
    report.converged = convergence_.reached(report);
    if (!std::isfinite(report.energy)) break;  // the integrator refuses the state
  }
  return report;
}

void VanillaPd::global_step(Positions& x, StepReport& report) {
  const auto count = static_cast<std::size_t>(reduction_.count());
  parallel_for(count, [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    increment_.row(row) = -reduction_.row(gradient_, static_cast<int>(i));
  });
  if (solver_->solve(increment_) != global::SolveStatus::Ok)
    throw SimulationError("the global solve failed (out of memory)");
  reduction_.advance(increment_, x);
  convergence_.measure_increment(increment_, report);
}

}  // namespace piecework::baselines
