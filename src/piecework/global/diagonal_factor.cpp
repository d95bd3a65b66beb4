// Methods with a factor of K + D: of the present D, of an earlier one, or of one whose interface
// knows D only in part.

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include <piecework/core/error.hpp>
#include <piecework/global/eigen_views.hpp>

#include "column_sums.hpp"
#include "diagonal_methods.hpp"

namespace piecework::global {
namespace {

/// Keeps a factor of K + D_factored and solves by CG with it.
class FactorUpdate : public DiagonalUpdateSolver {
 public:
  explicit FactorUpdate(const DiagonalOptions& options) : options_(options) {}

 protected:
  SolveStatus prepare_method() override {
    values_.assign(values_of(*K_).begin(), values_of(*K_).end());
    diagonal_entry_.resize(static_cast<std::size_t>(K_->rows()));
    for (int v = 0; v < K_->outerSize(); ++v)
      for (int k = K_->outerIndexPtr()[v]; k < K_->outerIndexPtr()[v + 1]; ++k)
        if (K_->innerIndexPtr()[k] == v) diagonal_entry_[static_cast<std::size_t>(v)] = k;
    factored_ = Eigen::VectorXd::Zero(K_->rows());
    has_factor_ = false;
    make_factor(options_.precision);
    return SolveStatus::Ok;
  }

  virtual void make_factor(Precision precision) {
    factor_ = TreeSolver({.precision = precision,
                          .factor_in_single = true,
                          .contraction_limit = 0,
                          .partial_refactor = true});
    factor_.share_analysis(*tree_);
  }

  /// Rows where D is not the one of the factor.
  [[nodiscard]] std::vector<int> changed_rows() const {
    std::vector<int> rows;
    for (int v = 0; v < diagonal_.size(); ++v)
      if (diagonal_[v] != factored_[v]) rows.push_back(v);
    return rows;
  }

  [[nodiscard]] bool has_factor() const { return has_factor_; }

  [[nodiscard]] SolveStatus refactor(const std::vector<int>& rows) {
    const SparseMatrix& K = *K_;
    for (const int v : rows) {
      const int entry = diagonal_entry_[static_cast<std::size_t>(v)];
      values_[static_cast<std::size_t>(entry)] = K.valuePtr()[entry] + diagonal_[v];
    }
    factored_ = diagonal_;
    SolveStatus status = factor_.refactor_rows(values_, rows);
    if (status == SolveStatus::NotPositiveDefinite &&
        factor_.report().precision == Precision::Single) {
      make_factor(Precision::Double);
      status = factor_.factor(values_);
    }
    has_factor_ = status == SolveStatus::Ok;
    report_.refactored_rows = factor_.report().factored_rows;
    return status;
  }

  void precondition(const Positions& r, Positions& z) override { apply_factor(r, z); }

  void apply_factor(const Positions& r, Positions& z) {
    z.resize(r.rows(), 3);
    [[maybe_unused]] const SolveStatus status = factor_.solve(r.data(), z.data(), 3, 3, 1);
    PIECEWORK_ASSERT(status == SolveStatus::Ok);
    ++report_.applications;
  }

  DiagonalOptions options_;
  Eigen::VectorXd factored_;  ///< D of the factor
  TreeSolver factor_;

 private:
  std::vector<double> values_;       ///< of K + D_factored, on K's pattern
  std::vector<int> diagonal_entry_;  ///< per row
  bool has_factor_ = false;
};

class Refactor final : public FactorUpdate {
 public:
  using FactorUpdate::FactorUpdate;

 private:
  SolveStatus update_method() override {
    const std::vector<int> rows = changed_rows();
    return has_factor() && rows.empty() ? SolveStatus::Ok : refactor(rows);
  }
};

class LastFactor final : public FactorUpdate {
 public:
  using FactorUpdate::FactorUpdate;

 private:
  SolveStatus update_method() override {
    const bool first = !has_factor() || (factored_.array() == 0).all();
    const std::vector<int> rows = changed_rows();
    return first && !(has_factor() && rows.empty()) ? refactor(rows) : SolveStatus::Ok;
  }
};

/// Mild or very few changes: CG on the last factor, until its iterations have cost as much as a new
/// one. If D <= c D_factored and D_factored <= c D, then K + D and K + D_factored are equal up to
/// c too, and the condition is c^2 at most; every row beyond adds one eigenvalue outside.
class Adaptive final : public FactorUpdate {
 public:
  using FactorUpdate::FactorUpdate;

 private:
  SolveStatus update_method() override {
    spent_ += std::max(0, std::exchange(last_iterations_, 0) - 1);
    const std::vector<int> rows = changed_rows();
    const bool keep =
        changes(rows) <= options_.refactor_changes && spent_ <= options_.refactor_iterations;
    if (has_factor() && (rows.empty() || keep)) return SolveStatus::Ok;
    spent_ = 0;
    return refactor(rows);
  }

  /// Rows where D differs by more than the mild factor.
  [[nodiscard]] std::ptrdiff_t changes(const std::vector<int>& rows) const {
    return std::count_if(rows.begin(), rows.end(), [&](int v) {
      const auto [low, high] = std::minmax(diagonal_[v], factored_[v]);
      return high > options_.mild_change * low;
    });
  }

  int spent_ = 0;  ///< iterations beyond the first of each solve, since the last factorisation
};

/// Woodbury: with A = K + D_factored, rows J changed by the diagonal C and V = A^-1 E_J,
/// (A + E_J C E_J^T)^-1 = A^-1 - V (C^-1 + V_J)^-1 V^T.
class LowRank final : public FactorUpdate {
 public:
  using FactorUpdate::FactorUpdate;

 private:
  SolveStatus update_method() override {
    std::vector<int> rows = changed_rows();
    if (!has_factor() || static_cast<int>(rows.size()) > options_.max_rank) {
      rows_.clear();
      return refactor(rows);
    }
    rows_ = std::move(rows);
    solve_units();
    const auto rank = static_cast<Eigen::Index>(rows_.size());
    Eigen::MatrixXd small(rank, rank);
    for (Eigen::Index i = 0; i < rank; ++i)
      for (Eigen::Index j = 0; j < rank; ++j) small(i, j) = unit(j)(row(i), j % 3);
    for (Eigen::Index i = 0; i < rank; ++i)
      small(i, i) += 1 / (diagonal_[row(i)] - factored_[row(i)]);
    if (rank > 0) small_.compute(small);
    return SolveStatus::Ok;
  }

  void precondition(const Positions& r, Positions& z) override {
    apply_factor(r, z);
    if (rows_.empty()) return;
    Eigen::MatrixXd at_rows(static_cast<Eigen::Index>(rows_.size()), 3);
    for (Eigen::Index i = 0; i < at_rows.rows(); ++i) at_rows.row(i) = z.row(row(i));
    const Eigen::MatrixXd force = small_.solve(at_rows);
    for_each_row(z.rows(), [&](Eigen::Index v) {
      for (Eigen::Index j = 0; j < force.rows(); ++j) z.row(v) -= unit(j)(v, j % 3) * force.row(j);
    });
  }

  /// V, three columns to a block.
  void solve_units() {
    units_.resize((rows_.size() + 2) / 3);
    for (std::size_t block = 0; block < units_.size(); ++block) {
      rhs_ = Positions::Zero(diagonal_.size(), 3);
      for (std::size_t j = 3 * block; j < std::min(rows_.size(), 3 * block + 3); ++j)
        rhs_(rows_[j], static_cast<Eigen::Index>(j % 3)) = 1;
      apply_factor(rhs_, units_[block]);
    }
  }

  [[nodiscard]] int row(Eigen::Index i) const { return rows_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const Positions& unit(Eigen::Index j) const {
    return units_[static_cast<std::size_t>(j / 3)];
  }

  std::vector<int> rows_;
  std::vector<Positions> units_;
  Positions rhs_;
  Eigen::PartialPivLU<Eigen::MatrixXd> small_;
};

/// The interiors of K + D exactly; the interface as if D were zero inside: S_K + D_BB, an upper
/// bound of the true Schur complement, so that the preconditioner is SPD.
class FrozenSchur final : public FactorUpdate {
 public:
  using FactorUpdate::FactorUpdate;

 private:
  void make_factor(Precision precision) override {
    factor_ = TreeSolver({.precision = precision,
                          .factor_in_single = true,
                          .contraction_limit = 0,
                          .partial_refactor = true,
                          .frozen_interiors = options_.domains});
    factor_.share_analysis(*tree_);
  }

  SolveStatus prepare_method() override {
    const SolveStatus status = FactorUpdate::prepare_method();
    return status == SolveStatus::Ok ? refactor({}) : status;
  }

  SolveStatus update_method() override {
    const std::vector<int> rows = changed_rows();
    return rows.empty() ? SolveStatus::Ok : refactor(rows);
  }
};

}  // namespace

std::unique_ptr<DiagonalUpdateSolver> make_factor_update(DiagonalMethod method,
                                                         const DiagonalOptions& options) {
  if (method == DiagonalMethod::Refactor) return std::make_unique<Refactor>(options);
  if (method == DiagonalMethod::LastFactor) return std::make_unique<LastFactor>(options);
  return std::make_unique<Adaptive>(options);
}

std::unique_ptr<DiagonalUpdateSolver> make_low_rank_update(const DiagonalOptions& options) {
  return std::make_unique<LowRank>(options);
}

std::unique_ptr<DiagonalUpdateSolver> make_frozen_schur(const DiagonalOptions& options) {
  return std::make_unique<FrozenSchur>(options);
}

}  // namespace piecework::global
