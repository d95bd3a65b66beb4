#include <piecework/model/integrator.hpp>

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::model {
namespace {

bool all_finite(const Positions& x) {
  // 0 * inf and 0 * NaN are NaN, so the maximum keeps any trouble.
  return std::isfinite(parallel_max(static_cast<std::size_t>(x.rows()), [&](std::size_t v) {
    return (0.0 * x.row(static_cast<Eigen::Index>(v))).sum() + 0.0;
  }));
}

}  // namespace

Integrator::Integrator(const ClothModel& model, ExternalForces forces, std::vector<Pin> pins,
                       IntegratorOptions options, std::unique_ptr<Minimizer> minimizer,
                       std::unique_ptr<ContactTerms> contact)
    : model_(model),
      forces_(model, std::move(forces)),
      pins_(std::move(pins), model.start),
      options_(options),
      minimizer_(std::move(minimizer)),
      contact_(std::move(contact)) {}

void Integrator::prepare(const State& state) {
  minimizer_->prepare(held_at((state.step + 1) * options_.h));
}

std::vector<char> Integrator::held_at(double time) const {
  std::vector<char> fixed = pins_.fixed_at(time);
  model_.sewing.mark_held(fixed);
  return fixed;
}

State Integrator::initial_state(const std::vector<Vec3>& part_velocity) const {
  State state;
  state.x = model_.start;
  state.v = Positions::Zero(model_.num_vertices(), 3);
  for (std::size_t p = 0; p < part_velocity.size(); ++p)
    state.v.middleRows(model_.parts[p].first_vertex, model_.parts[p].num_vertices).rowwise() =
        part_velocity[p].transpose();
  pins_.place(0.0, state.x);
  model_.sewing.follow(0.0, state.x);
  return state;
}

bool Integrator::extrapolate_to(double end, const State& state) {
  if (!minimizer_->wants_extrapolation() || state.previous_v.size() == 0) return false;
  extrapolated_.resize(state.x.rows(), 3);
  parallel_for(static_cast<std::size_t>(state.x.rows()), [&](std::size_t i) {
    const auto v = static_cast<Eigen::Index>(i);
    extrapolated_.row(v) =
        state.x.row(v) + options_.h * (2 * state.v.row(v) - state.previous_v.row(v));
  });
  pins_.place(end, extrapolated_);
  model_.sewing.follow(end, extrapolated_);
  return true;
}

void Integrator::finish_contact(StepReport& report) {
  contact_->end_step(x_);
  report.contact = contact_->report();
  report.phases.cull = report.contact->cull_ms;
  report.phases.narrow = report.contact->narrow_ms;
  report.phases.check = report.contact->check_ms;
}

StepReport Integrator::step(State& state) {
  const Stopwatch total;
  Stopwatch phase;
  const double h = options_.h;
  const double end = (state.step + 1) * h;
  forces_.evaluate(state.x, state.v, state.time, h, acceleration_);
  const auto rows = static_cast<std::size_t>(state.x.rows());
  predicted_.resize(state.x.rows(), 3);
  parallel_for(rows, [&](std::size_t i) {
    const auto v = static_cast<Eigen::Index>(i);
    predicted_.row(v) = state.x.row(v) + h * (state.v.row(v) + h * acceleration_.row(v));
  });
  const std::vector<char> fixed = held_at(end);
  pins_.place(end, predicted_);
  if (!all_finite(predicted_))
    throw SimulationError(
        fmt::format("step {}: the prediction x + h v + h^2 a is not finite; "
                    "check forces, velocities and h = {} s",
                    state.step + 1, h));
  x_ = predicted_;
  model_.sewing.settle(end, model_.mass, fixed, x_);  // where the iterations then stay
  const bool extrapolate = extrapolate_to(end, state);
  std::vector<double> memory = state.memory;
  double misc = phase.lap();

  StepProblem problem{&predicted_, &fixed, &state.x, extrapolate ? &extrapolated_ : nullptr,
                      &memory,     {},     nullptr};
  if (iteration_observer_)
    problem.observer = [&](const StepReport& report, const Positions& x) {
      return iteration_observer_(state.step + 1, report, x);
    };
  problem.contact = contact_.get();
  if (contact_) contact_->begin_step(problem, state.time, end, state.obstacles);
  if (observer_) observer_(problem);
  StepReport report = minimizer_->minimize(problem, x_);

  phase.lap();
  if (!all_finite(x_) || !std::isfinite(report.energy))
    throw SimulationError(
        fmt::format("step {}: the solver left the finite numbers (energy {} J); "
                    "use a smaller h or softer material",
                    state.step + 1, report.energy));
  model_.sewing.follow(end, x_);  // to the last bit
  misc += phase.lap();
  if (contact_) {
    finish_contact(report);
    state.obstacles = contact_->lagging_obstacles();
  }
  phase.lap();
  if (minimizer_->wants_extrapolation()) state.previous_v = state.v;
  state.memory = std::move(memory);
  const double keep = options_.damping ? std::exp(-*options_.damping * h) : 1.0;
  parallel_for(rows, [&](std::size_t i) {
    const auto v = static_cast<Eigen::Index>(i);
    state.v.row(v) = keep * (x_.row(v) - state.x.row(v)) / h;
  });
  std::swap(state.x, x_);
  ++state.step;
  state.time = state.step * h;
  misc += phase.lap();
  report.phases.misc = misc;
  report.step_ms = total.elapsed_ms();
  return report;
}

}  // namespace piecework::model
