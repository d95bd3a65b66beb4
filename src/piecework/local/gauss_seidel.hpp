#pragma once

// The local step of [Lu25, Sec. 5]: projections one after the other inside a domain, domains in
// parallel.

#include <cstdint>
#include <memory>
#include <vector>

#include <piecework/decomposition/decomposition.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::local {

/// What a constraint solves for after its projection.
enum class SweepForm {
  /// Block Gauss-Seidel: K_ii x_i = b_i(y) - K_i,rest x_rest, rows of the whole system. Keeps the
  /// fixed points of projective dynamics and never raises the energy.
  Corrected,
  /// Eq. 12 as printed, read with the constraint's own term alone:
  ///     (M_i/h^2 + w_i A_i^T A_i) x_i = M_i/h^2 z_i + w_i A_i^T B_i y_i.
  /// Biased: its fixed points are not those of projective dynamics, and the energy may rise. Only
  /// for comparison with the paper's figures 7 and 12.
  LiteralEq12,
};

struct SweepOptions {
  SweepForm form = SweepForm::Corrected;
  int num_orders = 4;        ///< depth-first orders per domain, alternating. Chosen.
  bool fixed_order = false;  ///< always the first one [Lu25, Fig. 7]
  std::uint64_t seed = 1;
};

/// Sweeps over the constraints that have a projection (triangles and curved hinges; flat hinges
/// have none and act through K). In a domain, for each constraint i in depth-first order:
///     y_i <- P_i(x);   b += w_i A_i^T (y_i - y_i_old);   x_i <- K_ii^-1 (b_i - K_i,rest x_rest)
/// for those of its vertices that only this domain moves. Vertices of two and more domains,
/// prescribed ones, slaves of seams and what carries them stay where they are: so domains share
/// nothing that moves, and the result has the same bits for every number of threads and any order
/// of the domains. To be followed by JacobiStep::evaluate(), which projects everything again.
/// Works with the residual K x - b and increments of x: accurate far from the origin.
class GaussSeidel {
 public:
  /// \param model          must outlive this object; so must
  /// \param decomposition  of the model's triangles and hinges
  /// \param prescribed     per vertex: where orders start (the pins)   \param h  s
  GaussSeidel(const model::ClothModel& model, const decomposition::Decomposition& decomposition,
              const std::vector<char>& prescribed, double h, const SweepOptions& options = {});
  ~GaussSeidel();
  GaussSeidel(GaussSeidel&&) noexcept;

  /// One sweep over every domain. Not to be called twice at a time.
  /// \param[in,out] x  |V| x 3, m   \param iteration  of the step: chooses the order
  void sweep(Positions& x, const model::StepProblem& problem, int iteration);

  /// Vertices that sweeps move, unless they are held. Per vertex.
  [[nodiscard]] const std::vector<char>& interior() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace piecework::local
