#include <piecework/baselines/block_pcg.hpp>

#include <atomic>
#include <cmath>

#include <Eigen/Cholesky>

#include <piecework/core/parallel.hpp>

namespace piecework::baselines {
namespace {

double dot(const Positions& a, const Positions& b) {
  return parallel_sum<double>(static_cast<std::size_t>(a.rows()), [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    return a.row(row).dot(b.row(row));
  });
}

}  // namespace

bool BlockPcg::invert_diagonal(const model::HessianMatrix& H) {
  inverse_.resize(static_cast<std::size_t>(H.count()));
  std::atomic<bool> positive{true};
  parallel_for(inverse_.size(), [&](std::size_t column) {
    for (int k = H.system().outerIndexPtr()[column]; k < H.system().outerIndexPtr()[column + 1];
         ++k) {
      if (H.system().innerIndexPtr()[k] != static_cast<int>(column)) continue;
      const Eigen::LLT<Mat3> factor(H.block(k));
      if (factor.info() != Eigen::Success) positive = false;
      inverse_[column] = factor.solve(Mat3::Identity());
    }
  });
  return positive;
}

PcgReport BlockPcg::solve(const model::HessianMatrix& H, const Positions& b,
                          const PcgOptions& options, Positions& x) {
  PcgReport report;
  x.setZero(b.rows(), 3);
  report.indefinite = !invert_diagonal(H);
  if (report.indefinite) return report;
  const auto each_row = [&](const auto& body) {
    parallel_for(inverse_.size(), [&](std::size_t i) { body(static_cast<Eigen::Index>(i)); });
  };
  const auto precondition = [&](Eigen::Index i) {
    preconditioned_.row(i) =
        (inverse_[static_cast<std::size_t>(i)] * residual_.row(i).transpose()).transpose();
  };
  residual_ = b;
  preconditioned_.resize(b.rows(), 3);
  each_row(precondition);
  direction_ = preconditioned_;
  double rho = dot(residual_, preconditioned_);
  const double target = options.tolerance * options.tolerance * rho;
  while (rho > target && report.iterations < options.max_iterations) {
    H.multiply(direction_, product_);
    const double curvature = dot(direction_, product_);
    report.indefinite = !(curvature > 0);
    if (report.indefinite) return report;
    const double alpha = rho / curvature;
    each_row([&](Eigen::Index i) {
      x.row(i) += alpha * direction_.row(i);
      residual_.row(i) -= alpha * product_.row(i);
      precondition(i);
    });
    ++report.iterations;
    const double rho_next = dot(residual_, preconditioned_);
    const double beta = rho_next / rho;
    rho = rho_next;
    each_row([&](Eigen::Index i) {
      direction_.row(i) = preconditioned_.row(i) + beta * direction_.row(i);
    });
  }
  return report;
}

}  // namespace piecework::baselines
