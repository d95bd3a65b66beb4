#pragma once

// The second derivative itself, factored in 32 bits: the preconditioner where the metric is poor.

#include <memory>
#include <span>

#include <piecework/global/exact_solver.hpp>
#include <piecework/model/contact_terms.hpp>
#include <piecework/model/hessian_matrix.hpp>
#include <piecework/pd/hessian_product.hpp>

namespace piecework::pd {

/// (H + D)^-1 of 3 n_f unknowns in 32 bits. H is the projected second derivative of the cloth; D
/// bounds that of contact block by block of 3 x 3, so the pattern does not change with what
/// touches.
///
/// Wrinkled cloth moves most easily without stretching, along and across its surface at once. The
/// metric, scalar along the surface and scalar across it, does not know these motions; they are
/// what conjugate gradients in it take their time for. The price is 27 times the work of K~'s
/// factor.
class HessianFactor {
 public:
  HessianFactor();

  /// Forgets the pattern.
  void reset() { analysed_ = false; }

  /// False: not positive definite in 32 bits; there is no factor then.
  bool factor(model::HessianMatrix& hessian, std::span<const model::ContactBlock> contact,
              const model::ClothModel& model, const model::Reduction& reduction);

  /// d = (H + D)^-1 g, both n_f x 3. \pre factored
  void apply(const Positions& g, Positions& d);

  /// Iterations of conjugate gradients in the metric that take about as long as one factorisation,
  /// by counts. \param system  what the solver of K~ reports
  [[nodiscard]] static double price(const global::FactorReport& system,
                                    const HessianProduct& hessian);

 private:
  void add_contact(std::span<const model::ContactBlock> contact, const model::ClothModel& model,
                   const model::Reduction& reduction);

  global::TreeSolver tree_;
  bool analysed_ = false;
  std::vector<double> values_;  ///< of H + D, lower triangle
  std::vector<Mat3> bound_;     ///< D, per unknown
};

}  // namespace piecework::pd
