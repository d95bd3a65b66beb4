#pragma once

// The engine: projective dynamics by domains, whose outer loop converges on stiff, fine cloth too
// (docs/convergence.md).

#include <memory>
#include <optional>
#include <string>

#include <piecework/local/gauss_seidel.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/model/convergence.hpp>
#include <piecework/model/stepper.hpp>
#include <piecework/pd/acceleration.hpp>
#include <piecework/pd/inexact_newton.hpp>
#include <piecework/pd/metric.hpp>

namespace piecework::pd {

/// When the metric gets its normal part N Kn^-1 N^T.
enum class NormalPart {
  Never,
  /// When more iterations without it are to be expected than its factorisation costs. A step
  /// remembers how the step before went (State::memory), by counts only.
  Automatic,
  Always,
};

/// When Newton's direction takes the place of the accelerated one (InexactNewton).
enum class NewtonUse {
  Never,
  Touching,  ///< while anything touches
};

struct DdPdOptions {
  double h = 1.0 / 120.0;  ///< s
  double gravity = 9.81;   ///< magnitude that turns forces into weights for `gradient`, m/s^2
  model::StopOptions stop;
  AccelerationOptions acceleration;
  NormalPart normals = NormalPart::Automatic;
  NewtonUse newton = NewtonUse::Touching;
  ContactSolve contact_solve;
  int friction_renewals = 1;  ///< times that a converged step takes up the pressure it has found
  /// Sweeps over the constraints of each domain before they are projected together [Lu25, Sec. 5];
  /// absent: constraint-parallel projections only. SweepForm::LiteralEq12 may raise E and is taken
  /// as it is, so it goes with AccelerationKind::None.
  std::optional<local::SweepOptions> sweeps;
};

/// Minimises the incremental potential E [Lu25, Eq. 1]: accelerated local-global iterations in
/// increment form on the unknowns that pins and seams leave. From the better of the prediction z
/// and the extrapolation of the last two steps; E never rises.
class DdPd final : public model::Minimizer {
 public:
  /// \param model    must outlive this object  \param solver  of the global step
  /// \param domains  of the model, outlives this object; needed for sweeps only
  DdPd(const model::ClothModel& model, const DdPdOptions& options,
       std::unique_ptr<global::ExactSolver> solver,
       const decomposition::Decomposition* domains = nullptr);

  void prepare(const std::vector<char>& fixed) override;
  [[nodiscard]] model::SetupReport setup_report() const override;
  model::StepReport minimize(const model::StepProblem& problem, Positions& x) override;
  [[nodiscard]] bool wants_extrapolation() const override { return true; }
  [[nodiscard]] std::string description() const override;

 private:
  /// E and T^T grad E at x into a slot.
  struct Point {
    Positions x;  ///< |V| x 3, m
    Positions g;  ///< n_f x 3, N
    double energy = 0;
    int degenerate = 0;
  };

  void begin_step(const model::StepProblem& problem, model::StepReport& report);
  void judge(const model::StepProblem& problem, model::StepReport& report);
  /// Sweeps x first, if that is wanted.
  void evaluate(Point& point, const model::StepProblem& problem, model::StepReport& report);
  void choose_start(const model::StepProblem& problem, const Positions& predicted,
                    model::StepReport& report);
  bool move(const model::StepProblem& problem, model::StepReport& report);
  /// \param slope  grad E times `moved`, the way from now_ to trial_
  [[nodiscard]] bool is_acceptable(double slope, const Positions& moved, double scale);
  /// now_ <- trial_; the way there was scale times `moved`, the way wanted step d_.
  void accept(const Positions& moved, double scale, double step, model::StepReport& report);
  bool line_search(const model::StepProblem& problem, double slope, model::StepReport& report);
  void consider_normals(const std::vector<double>* memory, model::StepReport& report);
  void refresh_normals(model::StepReport& report);
  [[nodiscard]] double detection_ms() const;
  [[nodiscard]] bool wants_newton() const;
  [[nodiscard]] bool newton_is_outdated() const;
  /// Fills d_.
  void propose(const model::StepProblem& problem, model::StepReport& report);
  bool renew_friction(const model::StepProblem& problem, model::StepReport& report);
  void find_moved();
  void advance_held(const model::StepProblem& problem, model::StepReport& report);
  [[nodiscard]] bool normals_are_outdated(const model::StepReport& report) const;
  [[nodiscard]] bool believable(const model::StepReport& report);

  const model::ClothModel& model_;
  model::ContactTerms* contact_ = nullptr;  ///< of the step
  DdPdOptions options_;
  model::Convergence convergence_;
  double stiffness_ratio_ = 1;
  std::vector<char> fixed_;
  Metric metric_;
  std::unique_ptr<Acceleration> acceleration_;
  std::unique_ptr<InexactNewton> newton_;  ///< absent until first wanted
  bool newton_proposed_ = false;           ///< d_ is Newton's direction
  bool doubtful_ = false;                  ///< the stop rule holds, but is not believed
  bool newton_failed_ = false;             ///< the last one led nowhere
  int pcg_iterations_ = 0;                 ///< of the last direction
  int pcg_after_refresh_ = 0;              ///< of the first one with this metric; 0: none yet
  local::JacobiStep local_;
  const decomposition::Decomposition* domains_;
  std::unique_ptr<local::GaussSeidel> sweeps_;
  Positions moved_;       ///< n_f x 3: displacement with the sweep, or as far as contact lets it
  int last_refresh_ = 0;  ///< iteration of the step
  double gradient_at_refresh_ = 0;
  int without_progress_ = 0;  ///< iterations
  double best_gradient_ = 0;  ///< of the step
  int renewals_left_ = 0;     ///< of friction
  int held_attempts_ = 0;     ///< left
  Point now_, trial_;
  Point shorter_;       ///< while lengthen() tries more
  Positions gradient_;  ///< |V| x 3
  Positions d_;         ///< n_f x 3
};

}  // namespace piecework::pd
