#include <piecework/baselines/vanilla_pd.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::baselines {

using model::StepReport;
using model::StopRule;

void VanillaPd::ErrorEstimate::add(double dx_inf) {
  if (last_ > 0) ratios_.push_back(dx_inf / last_);
  if (ratios_.size() > kRatios) ratios_.pop_front();
  last_ = dx_inf;
}

double VanillaPd::ErrorEstimate::value() const {
  if (last_ == 0) return 0;
  // Early increments fall fast, before the slow modes are all that is left: too few ratios flatter.
  if (ratios_.size() < kRatios) return std::numeric_limits<double>::infinity();
  const double q = std::min(0.999, *std::max_element(ratios_.begin(), ratios_.end()));
  return q / (1.0 - q) * last_;
}

VanillaPd::VanillaPd(const model::ClothModel& model, double h, double gravity,
                     model::StopOptions stop, std::unique_ptr<global::ExactSolver> solver)
    : model_(model),
      stop_(stop),
      gravity_(gravity),
      unit_box_((model.start.colwise().maxCoeff() - model.start.colwise().minCoeff()).maxCoeff()),
      K_(assemble_system(model, h)),
      solver_(std::move(solver)),
      local_(model, h) {
  if (!(unit_box_ > 0)) unit_box_ = 1.0;  // a cloth that starts as a point
}

std::string VanillaPd::description() const {
  return "vanilla PD, Jacobi local step, " + solver_->description();
}

void VanillaPd::prepare(const std::vector<char>& fixed) {
  fixed_ = fixed;
  reduction_ = model::Reduction(model_, fixed);
  increment_.resize(reduction_.count(), 3);
  const auto status = solver_->factor(reduction_.system(K_), reduction_.vertices());
  if (status == global::SolveStatus::OutOfMemory)
    throw SimulationError(
        fmt::format("the factor of {} unknowns does not fit into memory", reduction_.count()));
  if (status != global::SolveStatus::Ok)
    throw SimulationError(
        "the system matrix is not positive definite; stiffness, density or h are "
        "too extreme for double precision: bring them closer together");
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

  ErrorEstimate error;
  const auto evaluate = [&] {
    watch.lap();
    const auto result = local_.evaluate(x, problem, gradient_);
    report.energy = result.energy;
    report.degenerate_projections = result.degenerate;
    report.gradient = relative_gradient();
    report.phases.local += watch.lap();
  };
  evaluate();
  while (report.iterations < stop_.max_iterations && !report.converged) {
    watch.lap();
    global_step(x, report);
    ++report.iterations;
    ++report.global_solves;
    report.phases.global += watch.lap();
    evaluate();
    error.add(report.dx_inf);
    report.error = error.value() * unit_box_ / model_.mean_edge;
    report.converged = converged(report);
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
  const auto row_sq = [&](std::size_t i) {
    return increment_.row(static_cast<Eigen::Index>(i)).squaredNorm();
  };
  const double sum_sq = parallel_sum<double>(count, row_sq);
  report.dx_2 = std::sqrt(sum_sq) / unit_box_;
  report.dx_rms = count > 0 ? std::sqrt(sum_sq / static_cast<double>(count)) / unit_box_ : 0;
  report.dx_inf = std::sqrt(parallel_max(count, row_sq)) / unit_box_;
}

double VanillaPd::relative_gradient() const {
  const auto count = static_cast<std::size_t>(reduction_.count());
  if (count == 0) return 0;
  const double sum_sq = parallel_sum<double>(count, [&](std::size_t i) {
    return reduction_.row(gradient_, static_cast<int>(i)).squaredNorm();
  });
  const double weight = model_.mass.sum() / static_cast<double>(model_.num_free()) * gravity_;
  return std::sqrt(sum_sq / static_cast<double>(count)) / weight;
}

bool VanillaPd::converged(const StepReport& report) const {
  if (report.iterations < stop_.min_iterations) return false;
  switch (stop_.rule) {
    case StopRule::Error:
      return report.error <= stop_.tolerance;
    case StopRule::Gradient:
      return report.gradient <= stop_.tolerance;
    case StopRule::Dx2:
      return report.dx_2 <= stop_.tolerance;
    case StopRule::DxRms:
      return report.dx_rms <= stop_.tolerance;
    case StopRule::DxInf:
      return report.dx_inf <= stop_.tolerance;
    case StopRule::Iterations:
      return report.iterations >= stop_.max_iterations;
  }
  return false;
}

}  // namespace piecework::baselines
