#pragma once

// Conjugate gradients with the inverse of the 3 x 3 diagonal blocks as preconditioner.

#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/model/hessian_matrix.hpp>

namespace piecework::baselines {

struct PcgOptions {
  double tolerance = 0.1;      ///< of the residual, relative to b, in the preconditioner's norm
  int max_iterations = 10000;  ///< chosen: far above what cloth needs; not reaching it is no error
};

struct PcgReport {
  int iterations = 0;
  bool indefinite = false;  ///< a direction of no or negative curvature was met; x is void
};

/// H x = b from x = 0. Sums have a fixed order: the same bits for every number of threads.
class BlockPcg {
 public:
  /// \param b       n_f x 3, N
  /// \param[out] x  n_f x 3, m
  PcgReport solve(const model::HessianMatrix& H, const Positions& b, const PcgOptions& options,
                  Positions& x);

 private:
  /// False if a diagonal block is not positive definite.
  bool invert_diagonal(const model::HessianMatrix& H);

  std::vector<Mat3> inverse_;
  Positions residual_, preconditioned_, direction_, product_;
};

}  // namespace piecework::baselines
