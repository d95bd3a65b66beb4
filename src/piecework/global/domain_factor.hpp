#pragma once

// What the primal-dual solver asks of a factor of one domain's matrix, in two forms, and plain
// reference implementations of both. A faster engine replaces them through DomainBackend.
//
// All calls on one object come from one thread at a time. analyze() is called for one domain after
// another (METIS keeps state of the process: side by side it gives other orderings from run to
// run); everything else runs for many domains at the same time and must not share state.

#include <cstddef>
#include <functional>
#include <memory>

#include <piecework/core/types.hpp>
#include <piecework/global/cholmod_solver.hpp>

namespace piecework::global {

/// Factor of K_RR^j, n x n symmetric positive definite; n = 0 is allowed.
class DomainFactor {
 public:
  DomainFactor() = default;
  virtual ~DomainFactor() = default;
  DomainFactor(const DomainFactor&) = delete;
  DomainFactor& operator=(const DomainFactor&) = delete;

  /// Ordering and symbolic analysis of K's pattern. K has the values of the first factorize().
  [[nodiscard]] virtual SolveStatus analyze(const SparseMatrix& K) = 0;
  /// Factors K, which has the pattern given to analyze(). On failure no factor is kept.
  [[nodiscard]] virtual SolveStatus factorize(const SparseMatrix& K) = 0;
  /// Overwrites b, n x 3, with K^-1 b.
  [[nodiscard]] virtual SolveStatus solve(RightHandSides& b) = 0;
  /// The same for any number of columns; set-up only.
  [[nodiscard]] virtual SolveStatus solve_many(Eigen::MatrixXd& b) = 0;

  [[nodiscard]] virtual std::size_t bytes() const = 0;  ///< of the stored factor
  [[nodiscard]] virtual double nonzeros() const = 0;    ///< nnz(L)
};

/// Partial factor of K^j in the order [internal | interface], n_I + n_B rows: K_II = L L^T,
/// Y = L^-1 K_IB, S = K_BB - Y^T Y. Only K_II need be positive definite; n_I = 0 and n_B = 0 are
/// allowed.
class CondensedDomain {
 public:
  CondensedDomain() = default;
  virtual ~CondensedDomain() = default;
  CondensedDomain(const CondensedDomain&) = delete;
  CondensedDomain& operator=(const CondensedDomain&) = delete;

  /// Ordering and symbolic analysis of K's pattern. K has the values of the first factorize().
  [[nodiscard]] virtual SolveStatus analyze(const SparseMatrix& K, int num_internal) = 0;
  /// Factors K, which has the pattern given to analyze(), and writes the Schur complement S,
  /// n_B x n_B, both triangles. On failure no factor is kept.
  [[nodiscard]] virtual SolveStatus factorize(const SparseMatrix& K, Eigen::MatrixXd& schur) = 0;
  /// The forward sweep on [b_I; b_B], (n_I + n_B) x 3, in place: y = L^-1 b_I over b_I (in any
  /// order of rows that expand() understands), b_B - Y^T y over b_B.
  virtual void condense(RightHandSides& b) = 0;
  /// The backward sweep on [y; x_B], in place: x_I = L^-T (y - Y x_B) over y; x_B stays.
  virtual void expand(RightHandSides& x) = 0;

  [[nodiscard]] virtual std::size_t bytes() const = 0;  ///< of L and Y
  [[nodiscard]] virtual double nonzeros() const = 0;    ///< nnz(L) + nnz(Y)
};

/// Makes the factors, one object per domain.
struct DomainBackend {
  std::function<std::unique_ptr<DomainFactor>()> make_factor;
  std::function<std::unique_ptr<CondensedDomain>()> make_condensed;
};

/// CHOLMOD for DomainFactor; Eigen's simplicial Cholesky with a sparse Y for CondensedDomain, which
/// is correct, not fast.
DomainBackend reference_backend();

}  // namespace piecework::global
