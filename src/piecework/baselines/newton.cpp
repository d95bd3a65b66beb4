#include <piecework/baselines/newton.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::baselines {

using model::HessianForm;
using model::StepReport;

namespace {

constexpr double kArmijo = 1e-4;     // customary [Nocedal and Wright 2006, Sec. 3.1]
constexpr int kMaxBacktracks = 40;   // chosen: t = 1e-12 at best, below any useful step
constexpr double kMaxForcing = 0.1;  // chosen, as in most inexact Newton methods

}  // namespace

Newton::Newton(const model::ClothModel& model, double h, double gravity, model::StopOptions stop,
               NewtonOptions options)
    : model_(model),
      options_(options),
      convergence_(model, gravity, stop),
      K_(assemble_system(model, h)),
      rounding_(model),
      hessian_(model),
      local_(model, h) {}

std::string Newton::description() const {
  const bool direct = options_.linear == NewtonLinear::Cholmod;
  return fmt::format(
      "{} Newton, {}", options_.hessian == HessianForm::Projected ? "projected" : "unprojected",
      direct ? global::CholmodSolver::description() : "PCG with 3 x 3 diagonal blocks");
}

void Newton::prepare(const std::vector<char>& fixed) {
  fixed_ = fixed;
  reduction_ = model::Reduction(model_, fixed);
  hessian_.set_pattern(reduction_, reduction_.system(K_));
  rounding_.set_system(hessian_.system());
  rhs_.resize(reduction_.count(), 3);
  if (options_.linear == NewtonLinear::Cholmod &&
      cholmod_.analyze(hessian_.scalars(), 3) != global::SolveStatus::Ok)
    throw SimulationError(
        fmt::format("the factor of 3 x {} unknowns does not fit into memory", reduction_.count()));
}

model::SetupReport Newton::setup_report() const {
  const global::FactorReport& report = cholmod_.report();
  return {report.analyze_ms, report.nonzeros, static_cast<double>(report.bytes)};
}

StepReport Newton::minimize(const model::StepProblem& problem, Positions& x) {
  StepReport report;
  Stopwatch watch;
  report.phases.refactor = 0;
  report.phases.global = 0;
  if (fixed_ != *problem.fixed) {
    prepare(*problem.fixed);
    report.phases.refactor = watch.lap();
  }
  convergence_.begin();
  current_.x = x;
  watch.lap();
  evaluate(problem, current_);
  convergence_.measure_gradient(reduction_, current_.gradient, report);
  report.phases.local = watch.lap();
  start_gradient_ = report.gradient;
  report.energy = current_.energy;
  report.degenerate_projections = current_.degenerate;
  bool go_on = problem.observe(report, current_.x);
  while (go_on && report.iterations < convergence_.stop().max_iterations && !report.converged &&
         iterate(problem, report)) {
    go_on = problem.observe(report, current_.x);
    report.converged = convergence_.reached(report);
  }
  x = current_.x;
  return report;
}

void Newton::evaluate(const model::StepProblem& problem, Point& point) {
  const auto result = local_.evaluate(point.x, problem, point.gradient);
  point.energy = result.energy;
  point.degenerate = result.degenerate;
}

bool Newton::iterate(const model::StepProblem& problem, StepReport& report) {
  bool moved = false;
  if (options_.hessian == HessianForm::Unprojected)
    moved = find_direction(problem, HessianForm::Unprojected, report) && search(problem, report);
  if (!moved)
    moved = find_direction(problem, HessianForm::Projected, report) && search(problem, report);
  if (!moved) return false;
  ++report.iterations;
  report.energy = current_.energy;
  report.degenerate_projections = current_.degenerate;
  convergence_.measure_increment(increment_, report);
  convergence_.measure_gradient(reduction_, current_.gradient, report);
  if (options_.linear == NewtonLinear::Cholmod &&
      convergence_.stop().rule == model::StopRule::Error)
    estimate_error(report);
  return true;
}

void Newton::take_residual() {
  parallel_for(static_cast<std::size_t>(reduction_.count()), [&](std::size_t i) {
    rhs_.row(static_cast<Eigen::Index>(i)) =
        -reduction_.row(current_.gradient, static_cast<int>(i));
  });
}

bool Newton::find_direction(const model::StepProblem& problem, HessianForm form,
                            StepReport& report) {
  take_residual();
  if (!solve(problem, form, report)) return false;
  return slope(current_.gradient) <= 0;  // false for NaN; 0 at a stationary point to the last bit
}

bool Newton::solve(const model::StepProblem& problem, HessianForm form, StepReport& report) {
  Stopwatch watch;
  hessian_.assemble(current_.x, problem, form);
  if (options_.linear == NewtonLinear::Pcg) {
    report.phases.refactor += watch.lap();
    const double forcing = std::sqrt(report.gradient / std::max(start_gradient_, 1e-300));
    const PcgReport pcg =
        pcg_.solve(hessian_, rhs_, {.tolerance = std::min(kMaxForcing, forcing)}, direction_);
    report.global_solves += pcg.iterations;
    report.phases.global += watch.lap();
    return !pcg.indefinite;
  }
  const auto status = cholmod_.refactor(hessian_.scalars());
  report.phases.refactor += watch.lap();
  if (status == global::SolveStatus::OutOfMemory)
    throw SimulationError("the factor of Newton's matrix does not fit into memory");
  if (status != global::SolveStatus::Ok) {
    if (form == HessianForm::Unprojected) return false;
    throw SimulationError(
        "Newton's matrix is not positive definite; stiffness, density or h are too extreme for "
        "double precision: bring them closer together");
  }
  direction_ = rhs_;
  if (cholmod_.solve(direction_.data(), 1) != global::SolveStatus::Ok)
    throw SimulationError("Newton's solve failed (out of memory)");
  ++report.global_solves;
  report.phases.global += watch.lap();
  return true;
}

double Newton::slope(const Positions& gradient) const {
  return parallel_sum<double>(static_cast<std::size_t>(reduction_.count()), [&](std::size_t i) {
    return reduction_.row(gradient, static_cast<int>(i))
        .dot(direction_.row(static_cast<Eigen::Index>(i)));
  });
}

bool Newton::acceptable(double slope_at_start, double t) const {
  const double rise = trial_.energy - current_.energy;
  if (rise <= kArmijo * t * slope_at_start) return true;  // false for NaN
  // Near the minimum E has no digits left to compare, but its slope still has.
  return std::abs(rise) <= rounding_.at(current_.energy, current_.x) &&
         std::abs(slope(trial_.gradient)) <= std::abs(slope_at_start);
}

bool Newton::search(const model::StepProblem& problem, StepReport& report) {
  Stopwatch watch;
  const double start_slope = slope(current_.gradient);
  double t = 1;
  bool found = false;
  for (int k = 0; k < kMaxBacktracks && !found; ++k) {
    increment_ = t * direction_;
    trial_.x = current_.x;
    reduction_.advance(increment_, trial_.x);
    evaluate(problem, trial_);
    found = acceptable(start_slope, t);
    if (found) break;
    // The lowest point of the parabola through what is known, within bounds.
    const double excess = trial_.energy - current_.energy - t * start_slope;
    const double best = -0.5 * t * t * start_slope / excess;
    t = std::isfinite(best) ? std::clamp(best, 0.1 * t, 0.5 * t) : 0.1 * t;
  }
  if (found) std::swap(current_, trial_);
  report.phases.local += watch.lap();
  return found;
}

void Newton::estimate_error(StepReport& report) {
  // Ratios of three increments, which the default estimate waits for, would cost more iterations
  // than the step. One more solve with the factor at hand gives the next increment, nearly.
  Stopwatch watch;
  take_residual();
  if (cholmod_.solve(rhs_.data(), 1) != global::SolveStatus::Ok) return;
  ++report.global_solves;
  const auto length_sq = [](const auto& rows) {
    return rows.rows() > 0 ? rows.rowwise().squaredNorm().maxCoeff() : 0.0;
  };
  const double next = std::sqrt(length_sq(rhs_));
  const double last = std::sqrt(length_sq(increment_));
  const double q = last > 0 ? std::min(0.999, next / last) : 0.0;
  report.error = next / (1.0 - q) / model_.mean_edge;
  report.phases.global += watch.lap();
}

}  // namespace piecework::baselines
