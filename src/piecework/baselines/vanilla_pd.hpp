#pragma once

// Vanilla projective dynamics [Bouaziz et al. 2014]: Jacobi local step, prefactored global step.
// With the undivided factor it is the baseline kept for ever; any other exact solver takes the same
// steps.

#include <memory>

#include <piecework/global/cholmod_solver.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/model/convergence.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::baselines {

/// L-G iteration in increment form: K dx = -grad E(x), x += dx, on the unknowns that pins and seams
/// leave (model::Reduction). Monotone in E.
class VanillaPd final : public model::Minimizer {
 public:
  /// \param model    must outlive this object
  /// \param h        time step, s
  /// \param gravity  magnitude that turns forces into weights for `gradient`, m/s^2
  /// \param solver   of the global step
  VanillaPd(const model::ClothModel& model, double h, double gravity, model::StopOptions stop,
            std::unique_ptr<global::ExactSolver> solver = global::make_cholmod_solver());

  void prepare(const std::vector<char>& fixed) override;
  [[nodiscard]] model::SetupReport setup_report() const override;
  model::StepReport minimize(const model::StepProblem& problem, Positions& x) override;
  [[nodiscard]] std::string description() const override;

 private:
  void global_step(Positions& x, model::StepReport& report);

  const model::ClothModel& model_;
  model::Convergence convergence_;
  SparseMatrix K_;
  std::vector<char> fixed_;
  model::Reduction reduction_;
  std::unique_ptr<global::ExactSolver> solver_;
  local::JacobiStep local_;
  Positions gradient_;
  global::RightHandSides increment_;
};

}  // namespace piecework::baselines
