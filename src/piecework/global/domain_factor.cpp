#include <piecework/global/domain_factor.hpp>

#include <vector>

#include <Eigen/SparseCholesky>

#include <piecework/core/error.hpp>
#include <piecework/global/dense_cholesky.hpp>

namespace piecework::global {
namespace {

class CholmodDomainFactor final : public DomainFactor {
 public:
  // CholmodSolver analyses and factors in one call, so the first factorize() has nothing to do.
  SolveStatus analyze(const SparseMatrix& K) override {
    first_status_ = solver_.factor(K);
    is_first_ = true;
    return first_status_ == SolveStatus::OutOfMemory ? first_status_ : SolveStatus::Ok;
  }

  SolveStatus factorize(const SparseMatrix& K) override {
    const SolveStatus status = is_first_ ? first_status_ : solver_.refactor(K);
    is_first_ = false;
    // CHOLMOD takes the rounding left in the last pivot of a singular matrix for a pivot.
    if (status == SolveStatus::Ok && solver_.smallest_pivot(K) < pivot_tolerance(K.rows())) {
      is_regular_ = false;
      return SolveStatus::NotPositiveDefinite;
    }
    is_regular_ = status == SolveStatus::Ok;
    return status;
  }

  SolveStatus solve(RightHandSides& b) override {
    return is_regular_ ? solver_.solve(b) : SolveStatus::NotFactored;
  }
  SolveStatus solve_many(Eigen::MatrixXd& b) override {
    return is_regular_ ? solver_.solve_many(b) : SolveStatus::NotFactored;
  }
  [[nodiscard]] std::size_t bytes() const override { return solver_.report().bytes; }
  [[nodiscard]] double nonzeros() const override { return solver_.report().nonzeros; }

 private:
  CholmodSolver solver_;
  SolveStatus first_status_ = SolveStatus::NotFactored;
  bool is_first_ = false;
  bool is_regular_ = false;
};

class SimplicialCondensedDomain final : public CondensedDomain {
 public:
  SolveStatus analyze(const SparseMatrix& K, int num_internal) override {
    num_internal_ = num_internal;
    const SparseMatrix K_II = K.topLeftCorner(num_internal, num_internal);
    if (num_internal > 0) llt_.analyzePattern(K_II);
    return SolveStatus::Ok;
  }

  SolveStatus factorize(const SparseMatrix& K, Eigen::MatrixXd& schur) override {
    const Eigen::Index num_interface = K.rows() - num_internal_;
    schur = K.bottomRightCorner(num_interface, num_interface).toDense();
    Y_.resize(num_internal_, num_interface);
    if (num_internal_ == 0) return SolveStatus::Ok;
    const SparseMatrix K_II = K.topLeftCorner(num_internal_, num_internal_);
    llt_.factorize(K_II);
    if (llt_.info() != Eigen::Success || !is_regular(K_II)) return SolveStatus::NotPositiveDefinite;
    const SparseMatrix K_IB = K.topRightCorner(num_internal_, num_interface);
    Y_ = llt_.permutationP() * K_IB;
    llt_.matrixL().solveInPlace(Y_);
    // Fixed order, column by column: Y^T Y as a dense product would lose the zeros of Y.
    const SparseMatrix product = Y_.transpose() * Y_;
    schur -= product.toDense();
    return SolveStatus::Ok;
  }

  void condense(RightHandSides& b) override {
    if (num_internal_ == 0) return;
    RightHandSides y = llt_.permutationP() * b.topRows(num_internal_);
    llt_.matrixL().solveInPlace(y);
    b.topRows(num_internal_) = y;
    b.bottomRows(Y_.cols()).noalias() -= Y_.transpose() * y;
  }

  void expand(RightHandSides& x) override {
    if (num_internal_ == 0) return;
    RightHandSides y = x.topRows(num_internal_);
    y.noalias() -= Y_ * x.bottomRows(Y_.cols());
    llt_.matrixU().solveInPlace(y);
    x.topRows(num_internal_) = llt_.permutationPinv() * y;
  }

  [[nodiscard]] std::size_t bytes() const override {
    return static_cast<std::size_t>(nonzeros()) * (sizeof(double) + sizeof(int));
  }
  [[nodiscard]] double nonzeros() const override {
    const Eigen::Index L = num_internal_ > 0 ? llt_.matrixL().nestedExpression().nonZeros() : 0;
    return static_cast<double>(L + Y_.nonZeros());
  }

 private:
  using Llt = Eigen::SimplicialLLT<SparseMatrix, Eigen::Lower, Eigen::AMDOrdering<int>>;

  [[nodiscard]] bool is_regular(const SparseMatrix& K_II) const {
    const Eigen::VectorXd diagonal = llt_.permutationP() * K_II.diagonal();
    const Eigen::VectorXd pivot = llt_.matrixL().nestedExpression().diagonal();
    const double tolerance = pivot_tolerance(pivot.size());
    for (Eigen::Index i = 0; i < pivot.size(); ++i)
      if (!(pivot[i] * pivot[i] > tolerance * diagonal[i])) return false;
    return true;
  }

  Eigen::Index num_internal_ = 0;
  Llt llt_;
  SparseMatrix Y_;  ///< L^-1 P K_IB
};

}  // namespace

DomainBackend reference_backend() {
  return {.make_factor = [] { return std::make_unique<CholmodDomainFactor>(); },
          .make_condensed = [] { return std::make_unique<SimplicialCondensedDomain>(); }};
}

}  // namespace piecework::global
