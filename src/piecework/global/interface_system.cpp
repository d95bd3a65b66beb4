#include <piecework/global/interface_system.hpp>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <sys/sysinfo.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/global/eigen_views.hpp>
#include <piecework/global/tree_solver.hpp>

namespace piecework::global {
namespace {

/// Columns solved at a time during set-up: enough for BLAS-3, little memory.
constexpr Eigen::Index kColumns = 64;

double physical_memory_bytes() {
  struct sysinfo info {};
  if (sysinfo(&info) != 0) return std::numeric_limits<double>::infinity();
  return static_cast<double>(info.totalram) * info.mem_unit;
}

void check_bytes(const std::string& what, double bytes, double limit, const char* remedy) {
  constexpr double kMiB = 1024.0 * 1024.0;
  if (bytes <= limit) return;
  throw InputError(fmt::format("primal-dual solver: {} takes {:.0f} MiB, more than {:.0f} MiB; {}",
                               what, bytes / kMiB, limit / kMiB, remedy));
}

const DomainDofs& domain_of(const InterfaceDofs& dofs, const DofCopy& copy) {
  return dofs.domains[static_cast<std::size_t>(copy.domain)];
}

/// Calls add(other multiplier, signed entry) for the terms of one multiplier's column of G_RR, copy
/// by copy (for a duplicate: the lower domain first) and ascending for each.
template <class Add>
void for_column_terms(const InterfaceDofs& dofs, std::span<const DomainBlocks> blocks,
                      int multiplier, const Add& add) {
  dofs.visit_copies(multiplier, [&](const DofCopy& copy, double own) {
    const DomainDofs& domain = domain_of(dofs, copy);
    const Eigen::MatrixXd& RR = blocks[static_cast<std::size_t>(copy.domain)].RR;
    const Eigen::Index column = copy.local - domain.num_internal;
    domain.visit_entries([&](int other, int dual, double coefficient) {
      add(other, coefficient * own * RR(dual, column));
    });
  });
}

class DenseMultiplierSolver final : public MultiplierSolver {
 public:
  SolveStatus factor(const InterfaceDofs& dofs, std::span<const DomainBlocks> blocks) override {
    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(dofs.num_multipliers(), dofs.num_multipliers());
    parallel_for(
        static_cast<std::size_t>(dofs.num_multipliers()),
        [&](std::size_t m) {
          for_column_terms(dofs, blocks, static_cast<int>(m), [&](int row, double value) {
            G(row, static_cast<Eigen::Index>(m)) += value;
          });
        },
        16);
    return cholesky_.factor(std::move(G), pivot_tolerance(dofs.num_multipliers()));
  }
  SolveStatus solve(RightHandSides& b) override {
    cholesky_.solve_in_place(b);
    return SolveStatus::Ok;
  }
  SolveStatus solve_many(Eigen::MatrixXd& b) override {
    cholesky_.solve_in_place(b);
    return SolveStatus::Ok;
  }
  [[nodiscard]] std::size_t bytes() const override { return cholesky_.bytes(); }
  [[nodiscard]] double nonzeros() const override { return cholesky_.nonzeros(); }

 private:
  DenseCholesky cholesky_;
};

/// TreeSolver with the calls that SparseMultiplierSolver makes.
class TreeCholesky {
 public:
  SolveStatus factor(const SparseMatrix& G) {
    tree_.analyze(pattern_of(G));
    return tree_.factor(values_of(G));
  }
  SolveStatus refactor(const SparseMatrix& G) { return tree_.factor(values_of(G)); }
  SolveStatus solve(RightHandSides& b) { return tree_.solve(b.data(), b.data(), 3, 1, b.rows()); }
  SolveStatus solve_many(Eigen::MatrixXd& b) {
    return tree_.solve(b.data(), b.data(), static_cast<int>(b.cols()), 1, b.rows());
  }
  [[nodiscard]] const FactorReport& report() const { return tree_.report(); }

 private:
  TreeSolver tree_;
};

template <class Cholesky>
class SparseMultiplierSolver final : public MultiplierSolver {
 public:
  SolveStatus factor(const InterfaceDofs& dofs, std::span<const DomainBlocks> blocks) override {
    const bool known = G_.rows() == dofs.num_multipliers() && G_.nonZeros() > 0;
    if (!known) make_pattern(dofs);
    parallel_for(
        static_cast<std::size_t>(dofs.num_multipliers()),
        [&](std::size_t m) {
          const int begin = G_.outerIndexPtr()[m];
          const int end = G_.outerIndexPtr()[m + 1];
          std::fill(G_.valuePtr() + begin, G_.valuePtr() + end, 0.0);
          // All lists of a column ascend: each copy's pass runs through the column once.
          int place = begin;
          int last_row = -1;
          for_column_terms(dofs, blocks, static_cast<int>(m), [&](int row, double value) {
            if (row < static_cast<int>(m)) return;
            if (row < last_row) place = begin;
            while (G_.innerIndexPtr()[place] != row) ++place;
            G_.valuePtr()[place] += value;
            last_row = row;
          });
        },
        16);
    return known ? cholesky_.refactor(G_) : cholesky_.factor(G_);
  }
  SolveStatus solve(RightHandSides& b) override { return cholesky_.solve(b); }
  SolveStatus solve_many(Eigen::MatrixXd& b) override { return cholesky_.solve_many(b); }
  [[nodiscard]] std::size_t bytes() const override {
    return cholesky_.report().bytes +
           static_cast<std::size_t>(G_.nonZeros()) * (sizeof(double) + sizeof(int));
  }
  [[nodiscard]] double nonzeros() const override { return cholesky_.report().nonzeros; }

 private:
  /// The lower triangle of G_RR: two multipliers meet if a domain has both.
  void make_pattern(const InterfaceDofs& dofs) {
    std::vector<std::vector<int>> of_domain;
    for (const DomainDofs& domain : dofs.domains) of_domain.push_back(domain.multipliers());
    std::vector<int> begin(1, 0);
    std::vector<int> item;
    std::vector<int> column;
    std::vector<int> longer;
    for (int m = 0; m < dofs.num_multipliers(); ++m) {
      column.clear();
      dofs.visit_copies(m, [&](const DofCopy& copy, double) {
        const std::vector<int>& a = of_domain[static_cast<std::size_t>(copy.domain)];
        longer.clear();
        std::set_union(std::lower_bound(a.begin(), a.end(), m), a.end(), column.begin(),
                       column.end(), std::back_inserter(longer));
        column.swap(longer);
      });
      item.insert(item.end(), column.begin(), column.end());
      begin.push_back(static_cast<int>(item.size()));
    }
    const std::vector<double> zeros(item.size(), 0.0);
    G_ = Eigen::Map<const SparseMatrix>(dofs.num_multipliers(), dofs.num_multipliers(),
                                        static_cast<Eigen::Index>(item.size()), begin.data(),
                                        item.data(), zeros.data());
  }

  SparseMatrix G_;  ///< lower triangle; kept, for its pattern
  Cholesky cholesky_;
};

/// G_RC = sum_j S_D^j (K_RR^j-1 K_RC^j)_D S_C^j - E, N_lambda x N_C (B_C^j is in K_RC^j already).
SparseMatrix sum_rc(const InterfaceDofs& dofs, std::span<const DomainBlocks> blocks) {
  std::vector<Eigen::Triplet<double, int>> triplets;
  for (std::size_t d = 0; d < dofs.domains.size(); ++d) {
    const DomainDofs& domain = dofs.domains[d];
    for (std::size_t c = 0; c < domain.corner.size(); ++c)
      domain.visit_entries([&](int multiplier, int dual, double coefficient) {
        triplets.emplace_back(multiplier, domain.corner[c],
                              coefficient * blocks[d].RC(dual, static_cast<Eigen::Index>(c)));
      });
  }
  for (const SeamCorner& e : dofs.seam_corners)
    triplets.emplace_back(e.multiplier, e.corner, -e.coefficient);
  SparseMatrix result(dofs.num_multipliers(), dofs.num_corners());
  result.setFromTriplets(triplets.begin(), triplets.end());
  return result;
}

/// G_CC = sum_j S_C^jT CC^j S_C^j, N_C x N_C.
Eigen::MatrixXd sum_cc(const InterfaceDofs& dofs, std::span<const DomainBlocks> blocks) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(dofs.num_corners(), dofs.num_corners());
  for (std::size_t d = 0; d < dofs.domains.size(); ++d) {
    const std::vector<int>& corner = dofs.domains[d].corner;
    for (std::size_t b = 0; b < corner.size(); ++b)
      for (std::size_t a = 0; a < corner.size(); ++a)
        result(corner[a], corner[b]) +=
            blocks[d].CC(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
  }
  return result;
}

}  // namespace

std::unique_ptr<MultiplierSolver> make_multiplier_solver(InterfaceKind kind) {
  if (kind == InterfaceKind::Dense) return std::make_unique<DenseMultiplierSolver>();
  if (kind == InterfaceKind::Sparse)
    return std::make_unique<SparseMultiplierSolver<CholmodSolver>>();
  return std::make_unique<SparseMultiplierSolver<TreeCholesky>>();
}

void InterfaceSystem::check_size(const InterfaceDofs& dofs, const InterfaceOptions& options) {
  const double limit = std::min(options.max_bytes, 0.25 * physical_memory_bytes());
  const auto multipliers = static_cast<double>(dofs.num_multipliers());
  const auto corners = static_cast<double>(dofs.num_corners());
  double blocks = 0;
  for (const DomainDofs& domain : dofs.domains) {
    const auto of_domain = static_cast<double>(domain.multipliers().size());
    blocks += of_domain * (of_domain + domain.num_corners);
  }
  check_bytes(fmt::format("the dense corner matrix of {} corners", dofs.num_corners()),
              corners * corners * sizeof(double), limit,
              "lower corner_fraction or use fewer domains");
  // The sparse interface counts its entries with int.
  const double entry_bytes = sizeof(double) + sizeof(int);
  const double block_limit = std::min(limit, std::numeric_limits<int>::max() * entry_bytes);
  check_bytes(fmt::format("the interface of {} domains with {} multipliers, stored by blocks,",
                          dofs.domains.size(), dofs.num_multipliers()),
              blocks * entry_bytes, block_limit, "use more domains or raise corner_fraction");
  if (options.kind == InterfaceKind::Dense)
    check_bytes(fmt::format("the dense matrix of {} multipliers", dofs.num_multipliers()),
                multipliers * multipliers * sizeof(double), limit,
                "use the sparse interface, fewer domains or a larger corner_fraction");
}

SolveStatus InterfaceSystem::factor(const InterfaceDofs& dofs, std::span<const DomainBlocks> blocks,
                                    const InterfaceOptions& options) {
  if (!G_RR_ || kind_ != options.kind) G_RR_ = make_multiplier_solver(options.kind);
  kind_ = options.kind;
  const double w_bytes =
      static_cast<double>(dofs.num_multipliers()) * dofs.num_corners() * sizeof(double);
  stores_w_ = w_bytes <= options.max_w_bytes;
  W_.resize(0, 0);
  const SolveStatus status = G_RR_->factor(dofs, blocks);
  if (status != SolveStatus::Ok) return status;
  G_RC_ = sum_rc(dofs, blocks);
  return factor_corners(sum_cc(dofs, blocks), pivot_tolerance(dofs.num_rows));
}

/// Adds G_RC^T G_RR^-1 G_RC, a few columns at a time, and factors the sum.
SolveStatus InterfaceSystem::factor_corners(Eigen::MatrixXd G_CC, double tolerance) {
  if (stores_w_) W_.resize(G_RC_.rows(), G_RC_.cols());
  for (Eigen::Index first = 0; first < G_RC_.cols() && G_RC_.rows() > 0; first += kColumns) {
    const Eigen::Index count = std::min(kColumns, G_RC_.cols() - first);
    Eigen::MatrixXd W = G_RC_.middleCols(first, count).toDense();
    const SolveStatus status = G_RR_->solve_many(W);
    if (status != SolveStatus::Ok) return status;
    G_CC.middleCols(first, count).noalias() += G_RC_.transpose() * W;
    if (stores_w_) W_.middleCols(first, count) = W;
  }
  return G_CC_.factor(std::move(G_CC), tolerance);
}

SolveStatus InterfaceSystem::solve(RightHandSides& multipliers, RightHandSides& corners) {
  if (multipliers.rows() == 0) {
    G_CC_.solve_in_place(corners);
    return SolveStatus::Ok;
  }
  RightHandSides t = multipliers;
  SolveStatus status = G_RR_->solve(t);
  if (status != SolveStatus::Ok) return status;
  if (corners.rows() > 0) {
    corners.noalias() += G_RC_.transpose() * t;
    G_CC_.solve_in_place(corners);
    if (stores_w_) {
      t.noalias() -= W_ * corners;
    } else {
      t = multipliers;
      t.noalias() -= G_RC_ * corners;
      status = G_RR_->solve(t);
      if (status != SolveStatus::Ok) return status;
    }
  }
  multipliers = t;
  return SolveStatus::Ok;
}

std::size_t InterfaceSystem::bytes() const {
  return (G_RR_ ? G_RR_->bytes() : 0) + G_CC_.bytes() +
         static_cast<std::size_t>(W_.size()) * sizeof(double) +
         static_cast<std::size_t>(G_RC_.nonZeros()) * (sizeof(double) + sizeof(int));
}

double InterfaceSystem::nonzeros() const {
  return (G_RR_ ? G_RR_->nonzeros() : 0) + G_CC_.nonzeros();
}

}  // namespace piecework::global
