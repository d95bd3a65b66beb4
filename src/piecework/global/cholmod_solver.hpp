#pragma once

// The undivided direct solver: CHOLMOD supernodal Cholesky with METIS ordering, n x n with three
// right-hand sides. The honest baseline that every decomposed solver is compared with.

#include <cstddef>
#include <memory>
#include <string>

#include <piecework/core/types.hpp>

namespace piecework::global {

/// Outcome of factor() and solve().
enum class SolveStatus {
  Ok,
  NotPositiveDefinite,  ///< no factor is kept
  OutOfMemory,          ///< no factor is kept
  NotFactored,          ///< solve() came without a successful factor(); output not written
};

/// |V| x 3, column-major: the three right-hand sides one after the other, as BLAS wants them.
using RightHandSides = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor>;

struct FactorReport {
  double analyze_ms = 0;            ///< ordering and symbolic analysis; 0 if the pattern was known
  double factor_ms = 0;             ///< numeric factorisation
  double nonzeros = 0;              ///< nnz(L), structural
  double flops = 0;                 ///< of one numeric factorisation
  std::size_t bytes = 0;            ///< of the stored factor
  double reciprocal_condition = 0;  ///< crude estimate: (smallest / largest pivot of L)^2
};

/// K x = b with K |V| x |V| symmetric positive definite (N/m), b and x |V| x 3 (N, m).
/// One BLAS thread. Not thread-safe; one object per thread.
class CholmodSolver {
 public:
  CholmodSolver();
  ~CholmodSolver();
  CholmodSolver(CholmodSolver&&) noexcept;
  CholmodSolver& operator=(CholmodSolver&&) noexcept;

  /// Analyses and factors K, dropping any earlier factor; n = 0 is allowed.
  [[nodiscard]] SolveStatus factor(const SparseMatrix& K);

  /// Factors new values on the pattern of the last factor(): no new analysis.
  /// \pre K has that pattern.
  [[nodiscard]] SolveStatus refactor(const SparseMatrix& K);

  /// Overwrites b with K^-1 b. \pre b has K's number of rows.
  [[nodiscard]] SolveStatus solve(RightHandSides& b);

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

}  // namespace piecework::global
