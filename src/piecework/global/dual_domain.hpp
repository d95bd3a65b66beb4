#pragma once

// One domain's part in the primal-dual global solve [Lu25, Eqs. 7-8].

#include <memory>

#include <piecework/core/types.hpp>
#include <piecework/global/domain_factor.hpp>
#include <piecework/global/interface_dofs.hpp>

namespace piecework::global {

/// How a domain applies K_RR^j-1.
enum class DomainForm {
  Literal,   ///< two solves with K_RR^j per global solve, as [Lu25, Fig. 3] prints it
  OneSweep,  ///< one forward and one backward sweep around a dense S_DD^j (docs/architecture.md,
             ///< D14)
};

/// A domain's terms of G, without the entries of S_D^j, N_D^j dual rows and N_C^j corners.
struct DomainBlocks {
  Eigen::MatrixXd RR;  ///< (K_RR^-1)_DD, N_D^j x N_D^j, m/N
  Eigen::MatrixXd RC;  ///< (K_RR^-1 K_RC)_D, N_D^j x N_C^j, 1
  Eigen::MatrixXd CC;  ///< K_CC - K_RC^T K_RR^-1 K_RC, N_C^j x N_C^j, N/m
};

/// K^j in the order [internal | dual | corners], dual rows being duplicates and sewn ones; R =
/// internal and dual. The vectors of reduce() and expand() have that order, size() x 3. analyze()
/// runs for one domain at a time, the rest for different domains at the same time.
class DualDomain {
 public:
  DualDomain() = default;
  virtual ~DualDomain() = default;
  DualDomain(const DualDomain&) = delete;
  DualDomain& operator=(const DualDomain&) = delete;

  /// Ordering and symbolic analysis of K's pattern. K has the values of the first factorize().
  [[nodiscard]] virtual SolveStatus analyze(const SparseMatrix& K, const DomainDofs& dofs) = 0;
  /// Factors K_RR^j and writes the blocks. NotPositiveDefinite if K_RR^j is not.
  [[nodiscard]] virtual SolveStatus factorize(const SparseMatrix& K, DomainBlocks& blocks) = 0;
  /// [b_I; b_D; 0] -> dual rows (K_RR^-1 b_R)_D and of corners -K_RC^T K_RR^-1 b_R; what
  /// then stands in the internal rows belongs to expand().
  [[nodiscard]] virtual SolveStatus reduce(RightHandSides& work) = 0;
  /// [as reduce() left it; S_D^jT lambda; x_C] -> [x_I; x_D; x_C],
  /// x_R = K_RR^-1 (b_R - S_D^jT lambda - K_RC x_C) [Lu25, Eq. 7].
  [[nodiscard]] virtual SolveStatus expand(RightHandSides& work) = 0;

  [[nodiscard]] virtual std::size_t bytes() const = 0;
  [[nodiscard]] virtual double nonzeros() const = 0;
};

std::unique_ptr<DualDomain> make_dual_domain(DomainForm form, const DomainBackend& backend);

}  // namespace piecework::global
