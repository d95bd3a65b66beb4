#pragma once

// Projective dynamics without a factor: Jacobi instead of the global solve, accelerated by the
// Chebyshev semi-iterative method [Wang 2015].

#include <optional>
#include <vector>

#include <piecework/baselines/rounding.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/model/convergence.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::baselines {

struct PdJacobiOptions {
  /// Spectral radius of the Jacobi iteration that Chebyshev's weights are made for, 0 to below 1.
  /// Absent: 1 - gamma min_v m_v / (h^2 K_vv), the bound that inertia gives for any shape. Ratios
  /// of early increments, the usual estimate, fall short: the sequence then takes several times as
  /// long, while rho above the truth costs a few dropped iterates (measured on hanging sheets).
  std::optional<double> rho;
  /// Under-relaxation; absent: from the largest eigenvalue of D^-1 K~, as large as is stable.
  std::optional<double> gamma;
};

/// One local projection and one Jacobi sweep per iteration, on the unknowns that pins and seams
/// leave (model::Reduction):
///     dx_k+1 = omega_k+1 (gamma D^-1 (-grad E(x_k))) + (omega_k+1 - 1) dx_k,   D = diag(K~),
///     omega = 1 in the first iterations, then 2 / (2 - rho^2), then 4 / (4 - rho^2 omega)
/// which is [Wang 2015, Alg. 1] in increments. Where E would rise or leave the finite
/// numbers the iterate is dropped and the sequence begins anew with a plain sweep, which lowers E
/// for certain (K bounds the second derivative from above, and gamma < 2 / lambda_max). So E never
/// rises by more than its rounding. A dropped iterate counts as an iteration, since it costs as
/// much.
///
/// Phases: local is the projections, global the sweeps; nothing is factored.
class PdJacobi final : public model::Minimizer {
 public:
  /// \param model    must outlive this object
  /// \param h        time step, s
  /// \param gravity  magnitude that turns forces into weights for `gradient`, m/s^2
  PdJacobi(const model::ClothModel& model, double h, double gravity, model::StopOptions stop,
           PdJacobiOptions options = {});

  void prepare(const std::vector<char>& fixed) override;
  [[nodiscard]] model::SetupReport setup_report() const override { return {}; }
  model::StepReport minimize(const model::StepProblem& problem, Positions& x) override;
  [[nodiscard]] std::string description() const override;

  /// Of D^-1 K~, after prepare(): from below, by the power method.
  [[nodiscard]] double largest_eigenvalue() const { return largest_eigenvalue_; }

 private:
  struct Point {
    Positions x, gradient;  ///< |V| x 3
    double energy = 0;
    int degenerate = 0;
  };

  void evaluate(const model::StepProblem& problem, Point& point);
  void sweep();
  void accept(model::StepReport& report);
  [[nodiscard]] double next_omega() const;
  /// min_v m_v / (h^2 K_vv): D^-1 times the second derivative has no smaller eigenvalue where that
  /// is projected.
  [[nodiscard]] double least_inertia(const Eigen::VectorXd& diagonal) const;

  const model::ClothModel& model_;
  PdJacobiOptions options_;
  model::Convergence convergence_;
  double inverse_h_sq_;
  SparseMatrix K_;
  EnergyRounding rounding_;
  std::vector<char> fixed_;
  model::Reduction reduction_;
  Eigen::VectorXd step_;  ///< gamma / D, per unknown, m/N
  double largest_eigenvalue_ = 0;
  local::JacobiStep local_;
  Point current_, trial_;
  model::Unknowns increment_, trial_increment_;  ///< last accepted one and the one on trial
  // The sequence.
  int since_start_ = 0;  ///< accepted iterations since it began
  int plain_ = 0;        ///< of which the first are plain sweeps
  double omega_ = 1;
  double rho_ = 0;
};

}  // namespace piecework::baselines
