#pragma once

// The paper's exact global solve: one factor per domain, multipliers at vertices of two domains,
// global unknowns at corners [Lu25, Sec. 4.2, Eqs. 4-10; seams: Sec. 4.4, Eq. 11], corrected
// (docs/architecture.md, D11-D15, D18).

#include <limits>
#include <memory>
#include <span>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/global/domain_factor.hpp>
#include <piecework/global/dual_domain.hpp>
#include <piecework/global/interface_dofs.hpp>
#include <piecework/global/interface_system.hpp>
#include <piecework/global/tree_domain.hpp>

namespace piecework::global {

struct PrimalDualOptions {
  DomainForm form = DomainForm::OneSweep;
  InterfaceKind interface = InterfaceKind::Recursive;
  /// Backward error ||b - K x|| / (||K|| ||x|| + ||b||), inf-norms, the worst of the three columns,
  /// above which a step of iterative refinement follows (D15). Infinity: the error is not even
  /// estimated. Chosen: cloths of one material have 1e-15 to 5e-15 (up to 60K vertices) and so are
  /// solved once; contrasts of stiffness from about 1e6 on exceed it.
  double refine_tolerance = 1e-13;
  int max_refinements = 3;  ///< chosen: one step is enough up to contrasts of 1e9
  double max_interface_bytes = InterfaceOptions{}.max_bytes;  ///< see InterfaceOptions
  DomainBackend backend = tree_backend();
};

/// What factor() or refactor() did.
struct PrimalDualReport {
  int num_domains = 0;
  int num_multipliers = 0;          ///< N_lambda, those of seams included
  int num_seam_multipliers = 0;     ///< slaves of seams that are no corners
  int num_corners = 0;              ///< N_C
  double analyze_ms = 0;            ///< orderings of the domains; 0 if the patterns were known
  double domains_ms = 0;            ///< factors of the domains and their blocks of G
  double interface_ms = 0;          ///< G_RR, W, corner matrix
  double factor_ms = 0;             ///< everything
  std::size_t domain_bytes = 0;     ///< of the domains' factors
  std::size_t interface_bytes = 0;  ///< of G_RR's factor, G_RC, W and the corner matrix
  double domain_nonzeros = 0;       ///< of the domains' factors
  double interface_nonzeros = 0;    ///< of the factors of G_RR and the corner matrix
  bool stores_w = false;            ///< one solve with G_RR per global solve, not two
};

/// Where the last solve() spent its time; the steps of refinement are included.
struct PrimalDualTimes {
  double domains_ms = 0;    ///< sweeps through the domains, in parallel
  double interface_ms = 0;  ///< multipliers and corners, sequential as in [Lu25, Fig. 9]
  double residual_ms = 0;   ///< backward errors
  int refinements = 0;      ///< steps that were kept
  /// Backward error of the first and of the returned solution; NaN if not estimated.
  double first_error = std::numeric_limits<double>::quiet_NaN();
  double error = std::numeric_limits<double>::quiet_NaN();
};

/// K x = b with K = sum_j of the domains' shares, n x n symmetric positive definite (N/m), and b
/// and x n x 3 (N, m).
///
///     G_RR = sum_j S_D^j K_RR^j-1 S_D^jT                                      [Lu25, Eq. 8]
///     G_RC = sum_j S_D^j K_RR^j-1 K_RC^j S_C^j
///     G_CC = sum_j S_C^jT (K_CC^j - K_RC^jT K_RR^j-1 K_RC^j) S_C^j
///     b_R* = sum_j S_D^j K_RR^j-1 b_R^j,  b_C* = b_C - sum_j S_C^jT K_RC^jT K_RR^j-1 b_R^j
///     (G_CC + G_RC^T G_RR^-1 G_RC) x_C = b_C* + G_RC^T G_RR^-1 b_R*           [Eq. 10, corrected]
///     G_RR lambda = b_R* - G_RC x_C                                           [Eq. 9]
///     x_R^j = K_RR^j-1 (b_R^j - S_D^jT lambda - K_RC^j S_C^j x_C)
///
/// With seams (InterfaceDofs::seams) x minimises x^T K x / 2 - b^T x under x_s = sum_k T_sk x_k for
/// every slave s. Each slave that is no corner has one more multiplier, and [Lu25, Eq. 11],
/// corrected, is the system above with another G_RC and with B_C^jT K^j B_C^j in place of K^j:
///
///     sum_j S_D^j x_R^j + E x~_C = 0,  x_C = B_C x~_C
///     G~_RC = sum_j S_D^j K_RR^j-1 K_RC^j S_C^j B_C^j - E
///     (G~_CC + G~_RC^T G_RR^-1 G~_RC) x~_C = b~_C* + G~_RC^T G_RR^-1 b_R*
///     G_RR lambda = b_R* - G~_RC x~_C
///
/// As x = T x_f, b counts only through T^T b, whatever of it is on slaves: it is folded first,
/// which moves to the carriers what acts on their slaves.
///
/// b is divided evenly between the two copies of a duplicate, and x there is the mean of both.
/// With seams errors are those of T^T K T x_f = T^T b.
/// Domains run in parallel, sums run in domain order: the same bits for every number of threads.
/// Not thread-safe; one object per thread. Memory that cannot be had is OutOfMemory, never an
/// exception.
class PrimalDual {
 public:
  PrimalDual();
  ~PrimalDual();
  PrimalDual(PrimalDual&&) noexcept;
  PrimalDual& operator=(PrimalDual&&) noexcept;

  /// Analyses and factors, dropping any earlier factor.
  /// NotPositiveDefinite: a value is not finite, some K_RR^j is not positive definite (which K may
  /// be all the same, see split_matrix()), or K is not; both judged to working precision.
  /// \param domains  what `dofs` was made of by classify_dofs().
  /// \throws InputError if domains and dofs differ, options are out of range, or the interface is
  ///         too large: the text names the size and what to change. The earlier factor is kept
  ///         then.
  [[nodiscard]] SolveStatus factor(std::span<const DomainMatrix> domains, InterfaceDofs dofs,
                                   const PrimalDualOptions& options = {});

  /// Factors new values on the patterns of the last factor(), with its options.
  /// NotFactored if there was none that came as far as the values.
  /// \throws InputError if rows or numbers of entries are not those of the last factor().
  [[nodiscard]] SolveStatus refactor(std::span<const DomainMatrix> domains);

  /// Overwrites b with K^-1 b; untouched if the result is not Ok. Values of b that are not finite
  /// give x that is not, with status Ok. \pre b has n rows.
  [[nodiscard]] SolveStatus solve(RightHandSides& b);

  [[nodiscard]] const PrimalDualReport& report() const;
  [[nodiscard]] const PrimalDualTimes& last_times() const;  ///< of the last solve()

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace piecework::global
