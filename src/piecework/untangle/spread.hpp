#pragma once

// The global step: displacements of single vertices become a smooth motion of the cloth. Private to
// `untangle`.

#include <vector>

#include <piecework/global/tree_solver.hpp>
#include <piecework/model/reduction.hpp>

#include "pushes.hpp"

namespace piecework::untangle {

/// Solves (T_f^T (L + s I + D) T_f) u = T_f^T D t and moves x by T_f u: L the Laplacian of the
/// graph of edges, so that neighbours go along, whatever their material or shape; s a small number,
/// so that what is far does not; D and t the strength and the displacement of the pushes. A
/// vertex goes no farther than the farthest push (L is an M-matrix; without seams).
class Spread {
 public:
  /// \param setting  must outlive this object
  explicit Spread(const Setting& setting);

  /// \param reach  edges over which a displacement fades by a factor e: s = 1 / reach^2
  /// \throws SimulationError if the factor does not fit into memory
  void move(const Displacements& wanted, double reach, Positions& x);

  /// Nothing can move.
  [[nodiscard]] bool empty() const { return reduction_.count() == 0; }

 private:
  const Setting& setting_;
  model::Reduction reduction_;
  SparseMatrix laplacian_;  ///< L, |V| x |V|
  global::TreeSolver solver_;
  bool analyzed_ = false;
};

}  // namespace piecework::untangle
