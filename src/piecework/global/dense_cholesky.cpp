#include <piecework/global/dense_cholesky.hpp>

#include <utility>

namespace piecework::global {

SolveStatus DenseCholesky::factor(Eigen::MatrixXd A, double tolerance) {
  L_ = std::move(A);
  if (L_.rows() == 0) return SolveStatus::Ok;
  const Eigen::VectorXd diagonal = L_.diagonal();
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> in_place(L_);
  // Eigen lets NaN pass: `!(a > b)` does not.
  bool regular = in_place.info() == Eigen::Success;
  for (Eigen::Index i = 0; regular && i < L_.rows(); ++i)
    regular = L_(i, i) * L_(i, i) > tolerance * diagonal[i];
  if (regular) return SolveStatus::Ok;
  L_.resize(0, 0);
  return SolveStatus::NotPositiveDefinite;
}

}  // namespace piecework::global
