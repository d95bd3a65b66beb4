#include <piecework/pd/hessian_product.hpp>

#include <algorithm>

#include <piecework/core/parallel.hpp>

#include "kernels.hpp"

namespace piecework::pd {
namespace {

constexpr std::size_t kRowsPerTask = 256;

}  // namespace

void HessianProduct::set_pattern(const model::HessianMatrix& hessian) {
  const SparseMatrix& system = hessian.system();
  dense_ = scalar_ = {{0}, {}, {}};
  entries_.clear();
  for (int row = 0; row < hessian.count(); ++row) {  // H is symmetric: as column by column
    for (int k = system.outerIndexPtr()[row]; k < system.outerIndexPtr()[row + 1]; ++k) {
      const bool scalar = hessian.is_scalar(k);
      (scalar ? scalar_ : dense_).offset.push_back(3 * system.innerIndexPtr()[k]);
      if (scalar)
        scalar_.numbers.push_back(static_cast<float>(system.valuePtr()[k]));
      else
        entries_.push_back(k);
    }
    dense_.begin.push_back(static_cast<int>(dense_.offset.size()));
    scalar_.begin.push_back(static_cast<int>(scalar_.offset.size()));
  }
  dense_.numbers.assign(9 * entries_.size() + 1, 0);
}

void HessianProduct::take(const model::HessianMatrix& hessian) {
  parallel_for(entries_.size(), [&](std::size_t i) {
    // Column-major, and the transpose is wanted: the kernel reads it column by column.
    const Eigen::Matrix3f transposed = hessian.gathered(entries_[i]).transpose().cast<float>();
    std::copy_n(transposed.data(), 9, dense_.numbers.data() + 9 * i);
  });
}

void HessianProduct::multiply(const Positions& d, Positions& product) const {
  static const OuterKernels& kernels = outer_kernels(best_isa());
  const std::size_t rows = dense_.begin.size() - 1;
  product.resize(d.rows(), 3);
  const BlockRows matrix{{dense_.begin.data(), dense_.offset.data(), dense_.numbers.data()},
                         {scalar_.begin.data(), scalar_.offset.data(), scalar_.numbers.data()}};
  parallel_for((rows + kRowsPerTask - 1) / kRowsPerTask,
               [&](std::size_t task) {
                 const std::size_t begin = task * kRowsPerTask;
                 kernels.block_product(matrix, d.data(), begin,
                                       std::min(rows, begin + kRowsPerTask), product.data());
               },
               1);
}

double HessianProduct::bytes() const {
  const auto of = [](const auto& numbers) {
    return static_cast<double>(numbers.size() * sizeof(numbers[0]));
  };
  return of(dense_.offset) + of(dense_.numbers) + of(scalar_.offset) + of(scalar_.numbers);
}

}  // namespace piecework::pd
