#include <piecework/pd/dd_pd.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/assembly.hpp>

namespace piecework::pd {
namespace {

constexpr double kArmijo = 1e-4;
/// Energies closer than this, relative, are equal: their sum has rounded.
constexpr double kEnergyRounding = 1e-13;
constexpr int kMaxBacktracks = 30;
/// Iterations that lower neither the energy by more than rounding nor the gradient by a tenth: no
/// more is to be had.
constexpr int kPatience = 15;
constexpr double kProgress = 0.9;

/// Iterations with K alone before it is judged.
constexpr int kPlainIterations = 3;
/// What the normal part costs: its factorisation, in iterations.
constexpr double kIterationsPerFactor = 6;
/// In a long step the normals turn; the pairs that L-BFGS remembers stay valid.
constexpr int kIterationsPerRefresh = 15;
/// A step with normals that took no more iterations might have done without.
constexpr int kEasyIterations = 2;
/// Steps between two attempts without normals, at most.
constexpr double kLongestWait = 16;
/// Newton's direction: increments up to so many tolerances must be exact.
constexpr double kSafety = 4;
/// By what factor more inner iterations than with a fresh metric, and how many more, pay for
/// another one.
constexpr double kPcgGrowth = 1.5;
constexpr int kPcgAllowance = 10;
/// Times in a step that pins and obstacles which cloth has barred try to go on. What it then still
/// bars, pinched between them, waits for the next step.
constexpr int kHeldAttempts = 10;
/// Without normals an error is believed if the gradient allows at most so many times as much...
constexpr double kBelief = 100;
/// ... and with them after so many iterations, and if the gradient has fallen by no more than this
/// since they were taken: strain that has gone meanwhile bent them and hid how soft the cloth is.
constexpr int kIterationsToBelieve = 4;
constexpr double kOutdated = 100;
/// Nor is it if the metric alone would still move a vertex by more tolerances than this: L-BFGS
/// remembers bad pairs where it takes short steps. (Chosen: steps rightly taken for solved left up
/// to 160, one that was not 40000.)
constexpr double kLeftByMetric = 1000;

// State::memory: {steps with normals from the start to go, how many the next time}. Empty: none.

bool starts_with_normals(const std::vector<double>* memory) {
  return memory && !memory->empty() && memory->front() > 0;
}

/// A step that needed normals makes the next ones start with them; whether they are needed still
/// is tried again from time to time, less often after each vain attempt.
void remember(const model::StepReport& report, std::vector<double>& memory) {
  const bool started = starts_with_normals(&memory);
  if (report.normal_factors == 0) {
    memory.clear();
  } else if (!started) {
    const double wait = memory.empty() ? 1 : std::min(kLongestWait, 2 * memory.back());
    memory = {wait, wait};
  } else if (report.iterations <= kEasyIterations) {
    memory.front() -= 1;
  } else {
    memory.front() = memory.back();  // far from doing without
  }
}

}  // namespace

DdPd::DdPd(const model::ClothModel& model, const DdPdOptions& options,
           std::unique_ptr<global::ExactSolver> solver, const decomposition::Decomposition* domains)
    : model_(model),
      options_(options),
      convergence_(model, options.gravity, options.stop),
      metric_(model, assemble_system(model, options.h), std::move(solver), options.contact_solve),
      acceleration_(make_acceleration(options.acceleration)),
      local_(model, options.h),
      domains_(domains) {
  stiffness_ratio_ = model::stiffness_ratio(model, metric_.K(), options.h);
  PIECEWORK_ASSERT(!options.sweeps || domains);
}

std::string DdPd::description() const {
  std::string text = "DD-PD";
  if (options_.sweeps)
    text += options_.sweeps->form == local::SweepForm::Corrected ? ", Gauss-Seidel sweeps"
                                                                 : ", Eq. 12 as printed (biased)";
  text += ", " + to_string(options_.acceleration);
  if (options_.normals != NormalPart::Never) text += " in the metric K + N";
  return text + ", " + metric_.solver().description();
}

void DdPd::prepare(const std::vector<char>& fixed) {
  fixed_ = fixed;
  metric_.prepare(fixed);
  if (newton_) newton_->reset();
  if (options_.sweeps)
    sweeps_ = std::make_unique<local::GaussSeidel>(model_, *domains_, fixed, options_.h,
                                                   *options_.sweeps);
}

model::SetupReport DdPd::setup_report() const {
  const global::FactorReport& report = metric_.solver().report();
  return {report.analyze_ms + report.factor_ms, report.nonzeros, static_cast<double>(report.bytes)};
}

double DdPd::detection_ms() const { return contact_ ? contact_->report().detection_ms() : 0.0; }

void DdPd::evaluate(Point& point, const model::StepProblem& problem, model::StepReport& report) {
  const Stopwatch watch;
  if (sweeps_) sweeps_->sweep(point.x, problem, report.iterations);
  const auto result = local_.evaluate(point.x, problem, gradient_);
  point.energy = result.energy;
  const double detection_before = detection_ms();
  if (contact_) point.energy += contact_->evaluate(point.x, gradient_);
  metric_.reduction().gather(gradient_, point.g);
  point.degenerate = result.degenerate;
  ++report.evaluations;
  report.phases.local += watch.elapsed_ms() - (detection_ms() - detection_before);
}

void DdPd::choose_start(const model::StepProblem& problem, const Positions& predicted,
                        model::StepReport& report) {
  now_.x = predicted;
  const double held = contact_ ? contact_->start(now_.x) : 1.0;
  evaluate(now_, problem, report);
  if (!problem.extrapolated || held < 1) return;
  trial_.x = *problem.extrapolated;
  if (contact_ && contact_->start(trial_.x) < 1) return contact_->take_back_start();
  evaluate(trial_, problem, report);
  if (trial_.energy < now_.energy)
    std::swap(now_, trial_);
  else if (contact_)
    evaluate(now_, problem, report);  // contact speaks of its last evaluation
}

void DdPd::refresh_normals(model::StepReport& report) {
  const Stopwatch watch;
  const model::ContactTerms* contact = contact_ && contact_->touching() ? contact_ : nullptr;
  if (options_.normals != NormalPart::Never)
    metric_.refresh_normals(now_.x, contact);
  else if (contact)
    metric_.refresh_contact(*contact);
  acceleration_->metric_changed();
  ++report.normal_factors;
  last_refresh_ = report.iterations;
  pcg_after_refresh_ = 0;
  gradient_at_refresh_ = report.gradient;
  report.phases.refactor = std::max(0.0, report.phases.refactor) + watch.elapsed_ms();
}

void DdPd::consider_normals(const std::vector<double>* memory, model::StepReport& report) {
  const bool touching = contact_ && contact_->touching();
  if (options_.normals == NormalPart::Never && !touching) return;
  if (report.normal_factors > 0) {
    if (newton_proposed_) {
      if (newton_is_outdated()) refresh_normals(report);
      return;
    }
    if (report.iterations >= last_refresh_ + kIterationsPerRefresh ||
        (doubtful_ && normals_are_outdated(report)))
      refresh_normals(report);
    return;
  }
  const bool at_once =
      touching || options_.normals == NormalPart::Always || starts_with_normals(memory);
  const bool later = report.iterations >= kPlainIterations &&
                     convergence_.expected_iterations(report) > kIterationsPerFactor;
  if (at_once || later || doubtful_) refresh_normals(report);
}

bool DdPd::normals_are_outdated(const model::StepReport& report) const {
  return gradient_at_refresh_ > kOutdated * report.gradient;
}

/// The estimated error extrapolates increments, and K is as stiff against rotation as against
/// stretch: where inertia is weak beside it (stiff, light, small cloth, long steps) increments are
/// small and decay evenly although the cloth has yet to swing by many edges. With
/// E'' >= M / h^2, as it is up to buckling, the minimum is within h^2 M^-1 |grad E|. Where that
/// says too little, only increments in the metric with normals, which is soft where E is, count.
bool DdPd::believable(const model::StepReport& report) {
  if (newton_proposed_) return true;
  if (options_.normals == NormalPart::Never || options_.stop.rule != model::StopRule::Error)
    return true;
  const double farthest = options_.h * options_.h * options_.gravity * report.gradient;
  if (farthest <= kBelief * options_.stop.tolerance * model_.mean_edge) return true;
  if (!metric_.normals_in_use() || normals_are_outdated(report) ||
      report.iterations < last_refresh_ + kIterationsToBelieve || !convergence_.surely_holds())
    return false;
  metric_.apply(now_.g, d_);
  return longest(d_) <= kLeftByMetric * options_.stop.tolerance * model_.mean_edge;
}

bool DdPd::is_acceptable(double slope, const Positions& moved, double scale) {
  if (options_.sweeps && options_.sweeps->form == local::SweepForm::LiteralEq12)
    return std::isfinite(trial_.energy);
  const double rounding = kEnergyRounding * std::abs(now_.energy);
  if (trial_.energy < now_.energy - rounding) without_progress_ = 0;
  if (trial_.energy <= now_.energy + kArmijo * slope) return true;
  // Where energies differ by rounding only, the slopes still tell.
  return trial_.energy <= now_.energy + rounding &&
         std::abs(scale * dot(trial_.g, moved)) <= (1 - 2 * kArmijo) * -slope;
}

void DdPd::find_moved() {
  const model::Reduction& reduction = metric_.reduction();
  moved_.resize(d_.rows(), 3);
  parallel_for(static_cast<std::size_t>(d_.rows()), [&](std::size_t i) {
    const int v = reduction.vertex(static_cast<int>(i));
    moved_.row(static_cast<Eigen::Index>(i)) = trial_.x.row(v) - now_.x.row(v);
  });
}

bool DdPd::wants_newton() const {
  return options_.newton == NewtonUse::Touching && contact_ && contact_->touching() && !sweeps_ &&
         !newton_failed_;
}

bool DdPd::newton_is_outdated() const {
  return pcg_after_refresh_ > 0 &&
         pcg_iterations_ > kPcgGrowth * pcg_after_refresh_ + kPcgAllowance;
}

void DdPd::propose(const model::StepProblem& problem, model::StepReport& report) {
  newton_proposed_ = wants_newton();
  if (!newton_proposed_) {
    acceleration_->propose(now_.g, metric_, d_);
    ++report.global_solves;
    return;
  }
  if (!newton_) newton_ = std::make_unique<InexactNewton>(model_);
  newton_->assemble(now_.x, problem, metric_, contact_);
  pcg_iterations_ = newton_->solve(now_.g, kSafety * convergence_.small_increment(), metric_, d_);
  if (pcg_after_refresh_ == 0) pcg_after_refresh_ = std::max(1, pcg_iterations_);
  report.pcg_iterations += pcg_iterations_;
  report.global_solves += pcg_iterations_ + 1;
  acceleration_->restart();
}

bool DdPd::renew_friction(const model::StepProblem& problem, model::StepReport& report) {
  if (!contact_ || !contact_->renew_friction()) return false;
  evaluate(now_, problem, report);
  acceleration_->restart();
  return true;
}

void DdPd::accept(const Positions& moved, double scale, double step, model::StepReport& report) {
  if (!newton_proposed_) acceleration_->accept(scale, moved, now_.g, trial_.g);
  convergence_.assume_newton(newton_proposed_);
  convergence_.assume_stiffness_ratio(metric_.normals_in_use() ? 1.0 : stiffness_ratio_);
  // What contact or a barrier cut off is still to be done.
  const double wanted = sweeps_ ? scale : newton_proposed_ ? 1.0 : step;
  convergence_.measure_increment(sweeps_ ? moved : d_, wanted, report);
  std::swap(now_, trial_);
}

bool DdPd::line_search(const model::StepProblem& problem, double slope, model::StepReport& report) {
  const bool may_shorten = newton_proposed_ || acceleration_->scalable() || acceleration_->fresh();
  double step = 1;
  for (int k = 0; k < (may_shorten ? kMaxBacktracks : 1); ++k) {
    metric_.reduction().advance(now_.x, step, d_, trial_.x);
    const bool cut = contact_ && contact_->limit(now_.x, trial_.x);
    evaluate(trial_, problem, report);
    const bool other_way = sweeps_ || cut;
    if (other_way) find_moved();
    const Positions& moved = other_way ? moved_ : d_;
    const double scale = other_way ? 1.0 : step;
    if (is_acceptable(cut ? dot(now_.g, moved_) : step * slope, moved, scale)) {
      accept(moved, scale, step, report);
      return true;
    }
    // The minimum of the parabola through both slopes, kept within reason.
    const double wanted = step * slope / (slope - dot(trial_.g, d_));
    step = std::isfinite(wanted) ? std::clamp(wanted, 0.1 * step, 0.5 * step) : 0.1 * step;
  }
  return false;
}

/// Pins and obstacles that cloth barred go on.
void DdPd::advance_held(const model::StepProblem& problem, model::StepReport& report) {
  if (!contact_ || contact_->report().held_back == 0 || held_attempts_ == 0) return;
  --held_attempts_;
  if (!contact_->advance_held(now_.x)) return;
  evaluate(now_, problem, report);
  acceleration_->restart();
}

/// One iteration; false if no direction leads down any more.
bool DdPd::move(const model::StepProblem& problem, model::StepReport& report) {
  const Stopwatch watch;
  const double others_before = report.phases.local + detection_ms();
  const auto finish = [&](bool moved) {
    report.phases.global +=
        watch.elapsed_ms() - (report.phases.local + detection_ms() - others_before);
    return moved;
  };
  for (;;) {
    const bool fresh = acceleration_->fresh();
    propose(problem, report);
    const double slope = dot(now_.g, d_);
    if (slope < 0 && line_search(problem, slope, report)) return finish(true);
    if (contact_) evaluate(now_, problem, report);  // contact speaks of its last evaluation
    if (newton_proposed_) {
      newton_failed_ = true;
      continue;
    }
    // What was remembered misled. -P g leads down unless rounding is all that is left, or P is not
    // positive definite: nothing has checked the 32-bit factor of Kn, which K's may outlive.
    if (fresh && !metric_.normals_in_use()) return finish(false);
    if (fresh) metric_.drop_normals();
    acceleration_->restart();
  }
}

void DdPd::begin_step(const model::StepProblem& problem, model::StepReport& report) {
  report.phases.local = report.phases.global = 0;
  if (fixed_ != *problem.fixed) {
    const Stopwatch watch;
    prepare(*problem.fixed);
    report.phases.refactor = watch.elapsed_ms();
  }
  convergence_.begin();
  acceleration_->restart();
  metric_.drop_normals();
  contact_ = problem.contact;
  newton_proposed_ = newton_failed_ = doubtful_ = false;
  if (newton_) newton_->begin();
  renewals_left_ = options_.friction_renewals;
  held_attempts_ = kHeldAttempts;
  without_progress_ = 0;
}

/// Whether the iterate ends the step, and whether anything is still to be had.
void DdPd::judge(const model::StepProblem& problem, model::StepReport& report) {
  const bool reached = convergence_.reached(report);
  report.converged = reached && believable(report);
  doubtful_ = reached && !report.converged;
  const bool waiting = contact_ && contact_->report().held_back > 0 && held_attempts_ > 0;
  if (waiting) report.converged = false;
  if (report.converged && renewals_left_-- > 0 && renew_friction(problem, report))
    report.converged = false;
  if (report.gradient < kProgress * best_gradient_) {
    best_gradient_ = report.gradient;
    without_progress_ = 0;
  }
  report.stalled = !report.converged && ++without_progress_ > kPatience;
}

model::StepReport DdPd::minimize(const model::StepProblem& problem, Positions& x) {
  model::StepReport report;
  begin_step(problem, report);
  choose_start(problem, x, report);
  convergence_.measure_gradient(now_.g, report);
  best_gradient_ = report.gradient;
  report.energy = now_.energy;
  bool go_on = problem.observe(report, now_.x);
  while (go_on && report.iterations < options_.stop.max_iterations && !report.converged &&
         !report.stalled) {
    advance_held(problem, report);
    consider_normals(problem.memory, report);
    if (!move(problem, report)) {
      convergence_.measure_refused(d_, report);
      report.converged = convergence_.holds(report) && believable(report);
      report.stalled = !report.converged;
      break;
    }
    ++report.iterations;
    convergence_.measure_gradient(now_.g, report);
    report.energy = now_.energy;
    go_on = problem.observe(report, now_.x);
    judge(problem, report);
  }
  report.degenerate_projections = now_.degenerate;
  if (options_.normals == NormalPart::Automatic && problem.memory)
    remember(report, *problem.memory);
  std::swap(x, now_.x);
  return report;
}

}  // namespace piecework::pd
