#pragma once

// The interface system of the primal-dual global solve [Lu25, Eq. 8]: multipliers and corners.

#include <cstddef>
#include <memory>
#include <span>

#include <piecework/core/types.hpp>
#include <piecework/global/dense_cholesky.hpp>
#include <piecework/global/dual_domain.hpp>
#include <piecework/global/interface_dofs.hpp>

namespace piecework::global {

/// How G_RR is stored and factored.
enum class InterfaceKind {
  Dense,      ///< N_lambda x N_lambda, as [Lu25, Sec. 4.2] says ("a dense matrix")
  Sparse,     ///< by blocks as [Lu25, Fig. 24] shows it: CHOLMOD with METIS order
  Recursive,  ///< the same matrix factored and solved by TreeSolver, in parallel
};

struct InterfaceOptions {
  InterfaceKind kind = InterfaceKind::Sparse;
  /// Largest matrix of the interface, bytes; a quarter of the machine's memory if that is less.
  /// Chosen: beyond it the interface takes longer than everything else.
  double max_bytes = 2.0 * 1024 * 1024 * 1024;
  /// W = G_RR^-1 G_RC is kept while it is no larger than this, bytes (saves one solve with G_RR
  /// per global solve). PrimalDual sets the size of the domains' factors here.
  double max_w_bytes = 0;
};

/// Factor of G_RR, n x n symmetric positive definite with n multipliers.
class MultiplierSolver {
 public:
  MultiplierSolver() = default;
  virtual ~MultiplierSolver() = default;
  MultiplierSolver(const MultiplierSolver&) = delete;
  MultiplierSolver& operator=(const MultiplierSolver&) = delete;

  /// Sums G_RR = sum_j S_D^j RR^j S_D^jT in domain order and factors it. A second call with the
  /// same dofs keeps the analysis.
  [[nodiscard]] virtual SolveStatus factor(const InterfaceDofs& dofs,
                                           std::span<const DomainBlocks> blocks) = 0;
  /// Overwrites b, n x 3, with G_RR^-1 b.
  [[nodiscard]] virtual SolveStatus solve(RightHandSides& b) = 0;
  /// The same for any number of columns; set-up only.
  [[nodiscard]] virtual SolveStatus solve_many(Eigen::MatrixXd& b) = 0;
  [[nodiscard]] virtual std::size_t bytes() const = 0;
  [[nodiscard]] virtual double nonzeros() const = 0;  ///< of the factor
};

std::unique_ptr<MultiplierSolver> make_multiplier_solver(InterfaceKind kind);

/// Solves
///
///     [ G_RR     G_RC ] [ lambda ]   [  b_R* ]
///     [ G_RC^T  -G_CC ] [ x_C    ] = [ -b_C* ]                                [Lu25, Eq. 8]
///
/// by (G_CC + G_RC^T G_RR^-1 G_RC) x_C = b_C* + G_RC^T G_RR^-1 b_R* and
/// G_RR lambda = b_R* - G_RC x_C [Lu25, Eqs. 9-10, corrected: docs/architecture.md, D13].
class InterfaceSystem {
 public:
  /// \throws InputError that names the size and what to change, if a matrix would be larger than
  ///         allowed; nothing is changed then.
  static void check_size(const InterfaceDofs& dofs, const InterfaceOptions& options);

  /// NotPositiveDefinite: G_RR or the corner matrix is not; with positive definite K_RR^j the
  /// latter means that K is not.
  [[nodiscard]] SolveStatus factor(const InterfaceDofs& dofs, std::span<const DomainBlocks> blocks,
                                   const InterfaceOptions& options);

  /// b_R* -> lambda (N_lambda x 3, N), b_C* -> x_C (N_C x 3, m), in place.
  [[nodiscard]] SolveStatus solve(RightHandSides& multipliers, RightHandSides& corners);

  [[nodiscard]] bool stores_w() const { return stores_w_; }
  [[nodiscard]] std::size_t bytes() const;
  [[nodiscard]] double nonzeros() const;

 private:
  [[nodiscard]] SolveStatus factor_corners(Eigen::MatrixXd G_CC, double tolerance);

  std::unique_ptr<MultiplierSolver> G_RR_;
  InterfaceKind kind_ = InterfaceKind::Sparse;
  SparseMatrix G_RC_;   ///< N_lambda x N_C
  Eigen::MatrixXd W_;   ///< G_RR^-1 G_RC if stores_w_
  DenseCholesky G_CC_;  ///< of G_CC + G_RC^T G_RR^-1 G_RC
  bool stores_w_ = false;
};

}  // namespace piecework::global
