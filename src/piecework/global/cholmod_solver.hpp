#pragma once

// The undivided direct solver: CHOLMOD supernodal Cholesky with METIS ordering, n x n with three
// right-hand sides. The honest baseline that every decomposed solver is compared with.

#include <memory>
#include <string>

#include <piecework/core/types.hpp>
#include <piecework/global/exact_solver.hpp>
#include <piecework/global/status.hpp>

namespace piecework::global {

/// K x = b with K |V| x |V| symmetric positive definite (N/m), b and x |V| x 3 (N, m). The lower
/// triangle of K is used; the upper one need not be there.
/// One BLAS thread. Not thread-safe; one object per thread.
class CholmodSolver {
 public:
  CholmodSolver();
  ~CholmodSolver();
  CholmodSolver(CholmodSolver&&) noexcept;
  CholmodSolver& operator=(CholmodSolver&&) noexcept;

  /// Analyses and factors K, dropping any earlier factor; n = 0 is allowed.
  [[nodiscard]] SolveStatus factor(const SparseMatrix& K);

  /// Analyses the pattern of K (values are not looked at), dropping any earlier factor; refactor()
  /// has to follow. \param block  rows and columns come in groups of so many with one pattern, such
  /// as the coordinates of a vertex: groups are ordered, which takes a fraction of the time.
  [[nodiscard]] SolveStatus analyze(const SparseMatrix& K, int block);

  /// Factors new values on the pattern of the last factor() or analyze(): no new analysis.
  /// \pre K has that pattern.
  [[nodiscard]] SolveStatus refactor(const SparseMatrix& K);

  /// Overwrites b with K^-1 b. \pre b has K's number of rows.
  [[nodiscard]] SolveStatus solve(RightHandSides& b);

  /// The same for |V| x columns numbers in column-major order.
  [[nodiscard]] SolveStatus solve(double* b, int columns);

  /// The same for any number of columns, in new memory; for set-up, not for the time step.
  [[nodiscard]] SolveStatus solve_many(Eigen::MatrixXd& b) const;

  /// Smallest pivot relative to its diagonal entry, min_i L_ii^2 / K_ii: a few units of rounding if
  /// K is singular, whatever its scales are. 0 without a factor, 1 for n = 0.
  /// \pre K is the matrix of the last factorisation.
  [[nodiscard]] double smallest_pivot(const SparseMatrix& K) const;

  [[nodiscard]] const FactorReport& report() const;

  /// "CHOLMOD 3.0.14 supernodal, METIS, OpenBLAS 1 thread".
  [[nodiscard]] static std::string description();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// CholmodSolver behind the common face; domains play no part.
std::unique_ptr<ExactSolver> make_cholmod_solver();

}  // namespace piecework::global
