#pragma once

// The local step of projective dynamics, every constraint at the same frozen x: an exact
// minimisation over the projections y [Lu25, Sec. 3]. Right-hand side in increment form.

#include <memory>
#include <vector>

#include <piecework/core/isa.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::local {

/// Evaluates the incremental potential and its gradient with projections y_i = P_i(x):
///     E(x) = sum_v m_v |x_v - z_v|^2 / (2 h^2) + sum_i w_i/2 |A_i x - P_i(x)|^2   [Lu25, Eq. 1]
///     grad E = K x - b(P(x))                                                       [Lu25, Eq. 3]
/// Parallel over patches of the cloth, then over the vertices between patches, every sum in a fixed
/// order: the result has the same bits for every number of threads (per build and instruction set).
/// Element differences are taken before products, so it keeps its accuracy far from the origin.
/// The energy is a sum of squares, one per constraint: that of a nearly flat sheet is as accurate
/// as its curvature. (Flat hinges as one constant matrix Q take as long, and x.Qx cancels: see
/// docs/architecture.md.)
class JacobiStep {
 public:
  struct Result {
    double energy = 0;   ///< E(x), J; inertia of fixed vertices left out
    int degenerate = 0;  ///< triangles that needed the rank-deficient rule
  };

  /// \param model  must outlive this object.  \param h  time step, s.
  /// \param isa    this processor must run it; for tests
  JacobiStep(const model::ClothModel& model, double h, Isa isa = best_isa());
  ~JacobiStep();
  JacobiStep(JacobiStep&&) noexcept;

  /// \param x              |V| x 3, m
  /// \param[out] gradient  |V| x 3, N; zero at fixed vertices
  Result evaluate(const Positions& x, const model::StepProblem& problem, Positions& gradient);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace piecework::local
