#pragma once

// Newton's method on the incremental potential: the reference for accuracy, and a rival.

#include <piecework/baselines/block_pcg.hpp>
#include <piecework/baselines/rounding.hpp>
#include <piecework/global/cholmod_solver.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/model/convergence.hpp>
#include <piecework/model/hessian_matrix.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::baselines {

/// How the 3 n_f x 3 n_f system of an iteration is solved.
enum class NewtonLinear {
  Cholmod,  ///< Cholesky factor, its analysis done once per set of held vertices
  /// Conjugate gradients with 3 x 3 diagonal blocks, to the relative residual
  /// min(0.1, sqrt(|grad E| / |grad E at the start|)): superlinear without oversolving.
  Pcg,
};

struct NewtonOptions {
  /// Unprojected converges quadratically near the minimum, but each time that H is indefinite there
  /// is one factorisation in vain; projected never fails and has a linear tail where elements are
  /// compressed.
  model::HessianForm hessian = model::HessianForm::Projected;
  NewtonLinear linear = NewtonLinear::Cholmod;
};

/// x += t d, H d = -grad E(x), on the unknowns that pins and seams leave (model::Reduction), with t
/// from a backtracking line search (Armijo). Where H is unprojected and is not positive definite,
/// or d is no descent or leads nowhere, the projected H takes its place for that iteration. E never
/// rises by more than its rounding.
///
/// Phases: local is gradients, energies and the line search; refactor is assembly and factorisation
/// of H; global is the solves. `global_solves` counts triangular solves, or PCG iterations.
class Newton final : public model::Minimizer {
 public:
  /// \param model    must outlive this object
  /// \param h        time step, s
  /// \param gravity  magnitude that turns forces into weights for `gradient`, m/s^2
  Newton(const model::ClothModel& model, double h, double gravity, model::StopOptions stop,
         NewtonOptions options = {});

  void prepare(const std::vector<char>& fixed) override;
  [[nodiscard]] model::SetupReport setup_report() const override;
  /// \throws SimulationError if the projected H is not positive definite to rounding, or memory
  /// ends
  model::StepReport minimize(const model::StepProblem& problem, Positions& x) override;
  [[nodiscard]] std::string description() const override;

 private:
  struct Point {
    Positions x, gradient;  ///< |V| x 3
    double energy = 0;
    int degenerate = 0;
  };

  void evaluate(const model::StepProblem& problem, Point& point);
  /// rhs_ = -grad E at current_, on the unknowns.
  void take_residual();
  /// direction_ from H of this form at current_; false if that H will not do.
  bool find_direction(const model::StepProblem& problem, model::HessianForm form,
                      model::StepReport& report);
  bool solve(const model::StepProblem& problem, model::HessianForm form, model::StepReport& report);
  /// Moves current_ along direction_; false if no step was found.
  bool search(const model::StepProblem& problem, model::StepReport& report);
  [[nodiscard]] bool acceptable(double slope, double t) const;
  bool iterate(const model::StepProblem& problem, model::StepReport& report);
  void estimate_error(model::StepReport& report);
  /// grad E . direction on the unknowns, J.
  [[nodiscard]] double slope(const Positions& gradient) const;

  const model::ClothModel& model_;
  NewtonOptions options_;
  model::Convergence convergence_;
  SparseMatrix K_;
  EnergyRounding rounding_;
  std::vector<char> fixed_;
  model::Reduction reduction_;
  model::HessianMatrix hessian_;
  global::CholmodSolver cholmod_;
  BlockPcg pcg_;
  local::JacobiStep local_;
  Point current_, trial_;
  Positions rhs_, direction_;  ///< n_f x 3, N and m
  model::Unknowns increment_;
  double start_gradient_ = 0;
};

}  // namespace piecework::baselines
