#include <piecework/global/tree_domain.hpp>

#include <numeric>

#include <piecework/global/eigen_views.hpp>
#include <piecework/global/tree_solver.hpp>

namespace piecework::global {
namespace {

class TreeDomainFactor final : public DomainFactor {
 public:
  SolveStatus analyze(const SparseMatrix& K) override {
    tree_.analyze(pattern_of(K));
    return SolveStatus::Ok;
  }
  SolveStatus factorize(const SparseMatrix& K) override { return tree_.factor(values_of(K)); }
  SolveStatus solve(RightHandSides& b) override {
    return tree_.solve(b.data(), b.data(), 3, 1, b.rows());
  }
  SolveStatus solve_many(Eigen::MatrixXd& b) override {
    return tree_.solve(b.data(), b.data(), static_cast<int>(b.cols()), 1, b.rows());
  }
  [[nodiscard]] std::size_t bytes() const override { return tree_.report().bytes; }
  [[nodiscard]] double nonzeros() const override { return tree_.report().nonzeros; }

 private:
  TreeSolver tree_;
};

class TreeCondensedDomain final : public CondensedDomain {
 public:
  SolveStatus analyze(const SparseMatrix& K, int num_internal) override {
    boundary_.resize(K.rows() - num_internal, 3);
    std::vector<int> rows(static_cast<std::size_t>(boundary_.rows()));
    std::iota(rows.begin(), rows.end(), num_internal);
    tree_.analyze(pattern_of(K), nullptr, rows);
    return SolveStatus::Ok;
  }

  SolveStatus factorize(const SparseMatrix& K, Eigen::MatrixXd& schur) override {
    const SolveStatus status = tree_.factor(values_of(K));
    if (status != SolveStatus::Ok) return status;
    const Eigen::Index size = boundary_.rows();
    schur = Eigen::Map<const Eigen::MatrixXd>(tree_.schur().data(), size, size)
                .selfadjointView<Eigen::Lower>();
    return SolveStatus::Ok;
  }

  /// What the tree keeps of b_I between the sweeps stays inside it.
  void condense(RightHandSides& b) override {
    boundary_ = b.bottomRows(boundary_.rows());
    if (tree_.condense(b.data(), 3, 1, b.rows(), boundary_.data()) == SolveStatus::Ok)
      b.bottomRows(boundary_.rows()) = boundary_;
  }

  void expand(RightHandSides& x) override {
    boundary_ = x.bottomRows(boundary_.rows());
    [[maybe_unused]] const SolveStatus status =
        tree_.expand(boundary_.data(), x.data(), 3, 1, x.rows());
  }

  [[nodiscard]] std::size_t bytes() const override { return tree_.report().bytes; }
  [[nodiscard]] double nonzeros() const override { return tree_.report().nonzeros; }

 private:
  RightHandSides boundary_;
  TreeSolver tree_;
};

}  // namespace

DomainBackend tree_backend() {
  return {[] { return std::make_unique<TreeDomainFactor>(); },
          [] { return std::make_unique<TreeCondensedDomain>(); }};
}

}  // namespace piecework::global
