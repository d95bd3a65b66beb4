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
  const int* begin = system.outerIndexPtr();
  const int* column = system.innerIndexPtr();
  dense_ = scalar_ = {{0}, {}, {}};
  std::vector<int> place(static_cast<std::size_t>(system.nonZeros()), -1);
  for (int row = 0; row < hessian.count(); ++row) {  // H is symmetric: as column by column
    for (int k = begin[row]; k < begin[row + 1]; ++k) {
      const bool scalar = hessian.is_scalar(k);
      if (scalar)
        scalar_.numbers.push_back(static_cast<float>(system.valuePtr()[k]));
      else
        place[static_cast<std::size_t>(k)] = static_cast<int>(dense_.offset.size());
      (scalar ? scalar_ : dense_).offset.push_back(3 * column[k]);
    }
    dense_.begin.push_back(static_cast<int>(dense_.offset.size()));
    scalar_.begin.push_back(static_cast<int>(scalar_.offset.size()));
  }
  dense_.numbers.assign(9 * dense_.offset.size() + 1, 0);
  pairs_.clear();
  for (int row = 0; row < hessian.count(); ++row)
    for (int k = begin[row]; k < begin[row + 1]; ++k) {
      if (column[k] > row || place[static_cast<std::size_t>(k)] < 0) continue;
      const int* mirror =
          std::lower_bound(column + begin[column[k]], column + begin[column[k] + 1], row);
      pairs_.push_back({k, place[static_cast<std::size_t>(k)],
                        place[static_cast<std::size_t>(mirror - column)]});
    }
}

void HessianProduct::take(const model::HessianMatrix& hessian) {
  parallel_for(pairs_.size(), [&](std::size_t i) {
    const auto [k, place, mirror] = pairs_[i];
    // Block k stands in column `row`: the kernel, which reads column-major, wants its transpose.
    const Eigen::Matrix3f block = hessian.gathered(k).cast<float>();
    const auto numbers = [&](int p) {
      return Eigen::Map<Eigen::Matrix3f>(dense_.numbers.data() +
                                         9 * static_cast<std::ptrdiff_t>(p));
    };
    numbers(place) = block.transpose();
    if (mirror != place) numbers(mirror) = block;
  });
}

void HessianProduct::multiply(const Positions& d, Positions& product) const {
  static const OuterKernels& kernels = outer_kernels(best_isa());
  const auto rows = static_cast<std::size_t>(count());
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
