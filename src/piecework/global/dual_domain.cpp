#include <piecework/global/dual_domain.hpp>

#include <algorithm>
#include <utility>

#include <piecework/global/dense_cholesky.hpp>

namespace piecework::global {
namespace {

/// Columns solved at a time during set-up: enough for BLAS-3, little memory.
constexpr Eigen::Index kColumns = 64;

class LiteralDomain final : public DualDomain {
 public:
  explicit LiteralDomain(std::unique_ptr<DomainFactor> factor) : factor_(std::move(factor)) {}

  SolveStatus analyze(const SparseMatrix& K, const DomainDofs& dofs) override {
    num_internal_ = dofs.num_internal;
    num_dual_ = dofs.num_dual();
    return factor_->analyze(K.topLeftCorner(num_remainder(), num_remainder()));
  }

  SolveStatus factorize(const SparseMatrix& K, DomainBlocks& blocks) override {
    const Eigen::Index num_corners = K.rows() - num_remainder();
    K_RC_ = K.topRightCorner(num_remainder(), num_corners);
    const SolveStatus status =
        factor_->factorize(K.topLeftCorner(num_remainder(), num_remainder()));
    if (status != SolveStatus::Ok) return status;
    blocks.RR.resize(num_dual_, num_dual_);
    blocks.RC.resize(num_dual_, num_corners);
    blocks.CC = K.bottomRightCorner(num_corners, num_corners).toDense();
    for (Eigen::Index first = 0; first < num_dual_ + num_corners; first += kColumns) {
      const SolveStatus solved =
          add_columns(first, std::min(kColumns, num_dual_ + num_corners - first), blocks);
      if (solved != SolveStatus::Ok) return solved;
    }
    return SolveStatus::Ok;
  }

  SolveStatus reduce(RightHandSides& work) override {
    b_ = work.topRows(num_remainder());
    u_ = b_;
    const SolveStatus status = factor_->solve(u_);
    if (status != SolveStatus::Ok) return status;
    work.middleRows(num_internal_, num_dual_) = u_.bottomRows(num_dual_);
    work.bottomRows(K_RC_.cols()).noalias() -= K_RC_.transpose() * u_;
    return SolveStatus::Ok;
  }

  SolveStatus expand(RightHandSides& work) override {
    b_.bottomRows(num_dual_) -= work.middleRows(num_internal_, num_dual_);
    b_.noalias() -= K_RC_ * work.bottomRows(K_RC_.cols());
    const SolveStatus status = factor_->solve(b_);
    if (status == SolveStatus::Ok) work.topRows(num_remainder()) = b_;
    return status;
  }

  [[nodiscard]] std::size_t bytes() const override { return factor_->bytes(); }
  [[nodiscard]] double nonzeros() const override { return factor_->nonzeros(); }

 private:
  [[nodiscard]] Eigen::Index num_remainder() const { return num_internal_ + num_dual_; }

  /// Columns first ... first + count - 1 of K_RR^-1 [unit vectors of dual rows, K_RC], each placed
  /// into the blocks.
  SolveStatus add_columns(Eigen::Index first, Eigen::Index count, DomainBlocks& blocks) {
    Eigen::MatrixXd X = Eigen::MatrixXd::Zero(num_remainder(), count);
    for (Eigen::Index k = 0; k < count; ++k) {
      const Eigen::Index column = first + k;
      if (column < num_dual_)
        X(num_internal_ + column, k) = 1;
      else
        for (SparseMatrix::InnerIterator it(K_RC_, column - num_dual_); it; ++it)
          X(it.row(), k) = it.value();
    }
    const SolveStatus status = factor_->solve_many(X);
    if (status != SolveStatus::Ok) return status;
    for (Eigen::Index k = 0; k < count; ++k) {
      const Eigen::Index column = first + k;
      if (column < num_dual_) {
        blocks.RR.col(column) = X.col(k).tail(num_dual_);
      } else {
        blocks.RC.col(column - num_dual_) = X.col(k).tail(num_dual_);
        blocks.CC.col(column - num_dual_) -= K_RC_.transpose() * X.col(k);
      }
    }
    return SolveStatus::Ok;
  }

  std::unique_ptr<DomainFactor> factor_;
  Eigen::Index num_internal_ = 0;
  Eigen::Index num_dual_ = 0;
  SparseMatrix K_RC_;
  RightHandSides b_;  ///< b_R, kept from reduce() to expand()
  RightHandSides u_;  ///< K_RR^-1 b_R
};

// With S the Schur complement of the internal rows: (K_RR^-1)_DD = S_DD^-1,
// (K_RR^-1 K_RC)_D = S_DD^-1 S_DC, and K_CC - K_RC^T K_RR^-1 K_RC = S_CC - S_CD S_DD^-1 S_DC. So
// one forward sweep gives all that the interface needs, and one backward sweep ends the solve.
class OneSweepDomain final : public DualDomain {
 public:
  explicit OneSweepDomain(std::unique_ptr<CondensedDomain> factor) : factor_(std::move(factor)) {}

  SolveStatus analyze(const SparseMatrix& K, const DomainDofs& dofs) override {
    num_internal_ = dofs.num_internal;
    num_dual_ = dofs.num_dual();
    return factor_->analyze(K, dofs.num_internal);
  }

  SolveStatus factorize(const SparseMatrix& K, DomainBlocks& blocks) override {
    Eigen::MatrixXd S;
    SolveStatus status = factor_->factorize(K, S);
    if (status != SolveStatus::Ok) return status;
    const Eigen::Index num_corners = S.rows() - num_dual_;
    status = S_DD_.factor(S.topLeftCorner(num_dual_, num_dual_), pivot_tolerance(K.rows()));
    if (status != SolveStatus::Ok) return status;
    S_DC_ = S.topRightCorner(num_dual_, num_corners);
    blocks.RR = Eigen::MatrixXd::Identity(num_dual_, num_dual_);
    S_DD_.solve_in_place(blocks.RR);
    blocks.RC = S_DC_;
    S_DD_.solve_in_place(blocks.RC);
    blocks.CC = S.bottomRightCorner(num_corners, num_corners);
    blocks.CC.noalias() -= S_DC_.transpose() * blocks.RC;
    return SolveStatus::Ok;
  }

  SolveStatus reduce(RightHandSides& work) override {
    factor_->condense(work);
    u_D_ = work.middleRows(num_internal_, num_dual_);
    S_DD_.solve_in_place(u_D_);
    work.middleRows(num_internal_, num_dual_) = u_D_;
    work.bottomRows(S_DC_.cols()).noalias() -= S_DC_.transpose() * u_D_;
    return SolveStatus::Ok;
  }

  SolveStatus expand(RightHandSides& work) override {
    RightHandSides force = work.middleRows(num_internal_, num_dual_);
    force.noalias() += S_DC_ * work.bottomRows(S_DC_.cols());
    S_DD_.solve_in_place(force);
    work.middleRows(num_internal_, num_dual_) = u_D_ - force;
    factor_->expand(work);
    return SolveStatus::Ok;
  }

  [[nodiscard]] std::size_t bytes() const override {
    return factor_->bytes() + S_DD_.bytes() +
           static_cast<std::size_t>(S_DC_.size()) * sizeof(double);
  }
  [[nodiscard]] double nonzeros() const override {
    return factor_->nonzeros() + S_DD_.nonzeros() + static_cast<double>(S_DC_.size());
  }

 private:
  std::unique_ptr<CondensedDomain> factor_;
  Eigen::Index num_internal_ = 0;
  Eigen::Index num_dual_ = 0;
  DenseCholesky S_DD_;
  Eigen::MatrixXd S_DC_;
  RightHandSides u_D_;  ///< (K_RR^-1 b_R)_D, kept from reduce() to expand()
};

}  // namespace

std::unique_ptr<DualDomain> make_dual_domain(DomainForm form, const DomainBackend& backend) {
  if (form == DomainForm::Literal) return std::make_unique<LiteralDomain>(backend.make_factor());
  return std::make_unique<OneSweepDomain>(backend.make_condensed());
}

}  // namespace piecework::global
