#pragma once

// One face for all exact solvers of the global step, so that methods can choose among them.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/global/status.hpp>
#include <piecework/global/tree_solver.hpp>

namespace piecework::global {

/// |V| x 3, column-major: the three right-hand sides one after the other, as BLAS wants them.
using RightHandSides = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor>;

/// K x = b for the unknowns of a step. Used by one caller at a time.
class ExactSolver {
 public:
  virtual ~ExactSolver() = default;

  /// Analyses and factors K (n x n, N/m), dropping any earlier factor.
  /// \param row_vertex  per row: the vertex that it belongs to, for solvers that know domains
  [[nodiscard]] virtual SolveStatus factor(const SparseMatrix& K,
                                           std::span<const int> row_vertex) = 0;

  /// Overwrites b (N) with K^-1 b (m).
  [[nodiscard]] virtual SolveStatus solve(RightHandSides& b) = 0;

  /// Of the last factor().
  [[nodiscard]] virtual const FactorReport& report() const = 0;

  /// The tree behind it, for callers that go along with it (TreeSolver::solve_with()); or null.
  [[nodiscard]] virtual TreeSolver* tree() { return nullptr; }

  /// One line for reports after factor(): libraries, orderings, precision and why, if not as asked.
  [[nodiscard]] virtual std::string description() const = 0;
};

/// For callers that cannot go on without a factor.
/// \throws SimulationError unless Ok, with what to change.
void require_factor(SolveStatus status, int unknowns);

/// The borders of cloth domains per vertex; see DomainTree. Empty: no domains.
struct VertexTree {
  std::vector<int> node_parent;
  std::vector<int> vertex_node;
};

/// TreeSolver on the unknowns, with the borders of the domains as its top separators.
std::unique_ptr<ExactSolver> make_tree_solver(VertexTree domains, const TreeOptions& options);

}  // namespace piecework::global
