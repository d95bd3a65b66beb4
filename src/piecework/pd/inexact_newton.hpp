#pragma once

// Newton's direction by conjugate gradients in the engine's metric.
//
// L-BFGS learns what the metric does not know from the way that the iterates take. Where cloth
// touches, that way has kinks, and each of its points costs a detection: there the second
// derivative itself, with the exact coupling of what touches, is the cheaper teacher.

#include <memory>
#include <vector>

#include <piecework/model/contact_terms.hpp>
#include <piecework/model/hessian_matrix.hpp>
#include <piecework/pd/contact_product.hpp>
#include <piecework/pd/hessian_factor.hpp>
#include <piecework/pd/hessian_product.hpp>
#include <piecework/pd/metric.hpp>

namespace piecework::pd {

/// Solves H d = -g inexactly [Dembo, Eisenstat and Steihaug 1982]: H is the projected second
/// derivative of the incremental potential, contact and friction included, so positive definite;
/// the metric preconditions. Where that takes very long, a factor of H itself does so for the rest
/// of the step: a rule on counts. Same bits for every number of threads.
class InexactNewton {
 public:
  /// \param model  must outlive this object
  explicit InexactNewton(const model::ClothModel& model) : hessian_(model), model_(model) {}

  /// Forgets the pattern: other vertices are held.
  void reset();

  /// A new step.
  void begin();

  /// H at x (|V| x 3, m). \param contact  as evaluated there, or null
  void assemble(const Positions& x, const model::StepProblem& problem, const Metric& metric,
                const model::ContactTerms* contact);

  /// d = -H^-1 g, as exactly as the progress since the last call deserves; n_f x 3. Returns the
  /// iterations, kMaxIterations at most. d leads down whatever they are, above 0.
  /// \param small  m: a d that is nowhere longer than this must be exact, or it would be taken for
  ///               convergence
  int solve(const Positions& g, double small, Metric& metric, Positions& d);

 private:
  static constexpr int kMaxIterations = 200;

  double forcing(double norm_sq);
  void precondition(Metric& metric);
  bool factor();
  void multiply(const Positions& d, Positions& product);

  model::HessianMatrix hessian_;
  const model::ClothModel& model_;
  const model::Reduction* reduction_ = nullptr;  ///< the one that hessian_ has its pattern from
  std::vector<model::ContactBlock> blocks_;
  HessianProduct cloth_;
  ContactProduct contact_;
  std::unique_ptr<HessianFactor> factor_;  ///< absent until first worth it
  bool factored_ = false;                  ///< preconditions in the rest of the step
  bool factors_ = true;                    ///< as far as is known in this step
  double price_ = 0;                       ///< iterations that are worth a factor
  double last_norm_sq_ = 0;  ///< of the gradient in the metric, at the last solve(); 0: none
  Positions residual_, preconditioned_, direction_, product_;
};

}  // namespace piecework::pd
