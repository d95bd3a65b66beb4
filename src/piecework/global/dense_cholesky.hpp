#pragma once

// Dense Cholesky with a verdict on singular matrices.

#include <algorithm>
#include <limits>

#include <Eigen/Cholesky>

#include <piecework/core/types.hpp>
#include <piecework/global/cholmod_solver.hpp>

namespace piecework::global {

/// A pivot below this part of its diagonal entry is rounding: the matrix, made of `rows` rows, is
/// singular to working precision. (Chosen: finds every singular matrix of integers tried. A cloth
/// of a square metre that only its mass holds leaves 5e-4 at h = 1 s and 5e-10 at 1000 s, whatever
/// the number of rows.)
inline double pivot_tolerance(Eigen::Index rows) {
  return static_cast<double>(std::max<Eigen::Index>(10, rows)) *
         std::numeric_limits<double>::epsilon();
}

/// A = L L^T, n x n, in A's own memory.
class DenseCholesky {
 public:
  /// Takes A (lower triangle) and factors it. NotPositiveDefinite also if a pivot is below
  /// `tolerance` or not finite. n = 0 is allowed.
  [[nodiscard]] SolveStatus factor(Eigen::MatrixXd A, double tolerance);

  /// Overwrites b, n x any, with A^-1 b. \pre factor() was Ok.
  template <class Derived>
  void solve_in_place(Eigen::MatrixBase<Derived>& b) const {
    if (b.size() == 0) return;  // Eigen would bind a reference to no coefficient
    L_.triangularView<Eigen::Lower>().solveInPlace(b);
    L_.triangularView<Eigen::Lower>().transpose().solveInPlace(b);
  }

  [[nodiscard]] std::size_t bytes() const {
    return static_cast<std::size_t>(L_.size()) * sizeof(double);
  }
  [[nodiscard]] double nonzeros() const {
    const auto n = static_cast<double>(L_.rows());
    return n * (n + 1) / 2;
  }

 private:
  Eigen::MatrixXd L_;  ///< lower triangle; above it whatever A had there
};

}  // namespace piecework::global
