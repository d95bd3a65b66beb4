#pragma once

// The local step of projective dynamics, every constraint at the same frozen x: an exact
// minimisation over the projections y [Lu25, Sec. 3]. Right-hand side in increment form.

#include <cstdint>
#include <vector>

#include <piecework/model/constraints.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::local {

/// Evaluates the incremental potential and its gradient with projections y_i = P_i(x):
///     E(x) = sum_v m_v |x_v - z_v|^2 / (2 h^2) + sum_i w_i/2 |A_i x - P_i(x)|^2   [Lu25, Eq. 1]
///     grad E = K x - b(P(x))                                                       [Lu25, Eq. 3]
/// Parallel over constraints, then gathered per vertex in a fixed order: the result has the same
/// bits for every number of threads, and element differences are taken before products, so it
/// keeps its accuracy far from the origin.
class JacobiStep {
 public:
  struct Result {
    double energy = 0;   ///< E(x), J; inertia of fixed vertices left out
    int degenerate = 0;  ///< triangles that needed the rank-deficient rule
  };

  /// \param model  must outlive this object.  \param h  time step, s.
  JacobiStep(const model::ClothModel& model, double h);

  /// \param x              |V| x 3, m
  /// \param[out] gradient  |V| x 3, N; zero at fixed vertices
  Result evaluate(const Positions& x, const model::StepProblem& problem, Positions& gradient);

 private:
  struct Sum {
    double energy = 0;
    int degenerate = 0;
    Sum& operator+=(const Sum& other) {
      energy += other.energy;
      degenerate += other.degenerate;
      return *this;
    }
  };
  struct BendUse {
    int constraint;
    double coefficient;
  };

  Sum project_triangle(std::size_t t, const Positions& x, const model::StepProblem& problem);
  double project_bend(std::size_t i, const Positions& x);
  double gather(std::size_t v, const Positions& x, const model::StepProblem& problem,
                Positions& gradient) const;

  const model::ClothModel& model_;
  double inverse_h_sq_;
  Positions corner_force_;          ///< per triangle, three rows: force on each corner, N
  Positions bend_force_;            ///< per bending constraint, w (c^T x - y), N
  mesh::Adjacency vertex_corners_;  ///< per vertex: 3 * triangle + corner
  std::vector<int> bend_begin_;     ///< per vertex: offsets into bend_use_
  std::vector<BendUse> bend_use_;
};

}  // namespace piecework::local
