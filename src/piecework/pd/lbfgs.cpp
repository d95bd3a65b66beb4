#include "lbfgs.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <piecework/core/parallel.hpp>

namespace piecework::pd {
namespace {

constexpr std::size_t kBlock = 2048;  // numbers per step of a pass

/// Sums of a pass, one per slot.
struct Sums {
  std::array<double, 2 * (Lbfgs::kMaxWindow + 1)> value{};
  Sums& operator+=(const Sums& other) {
    for (std::size_t i = 0; i < value.size(); ++i) value[i] += other.value[i];
    return *this;
  }
};

struct Range {
  std::size_t begin, end;
};

Range block_range(std::size_t block, std::size_t size) {
  return {block * kBlock, std::min(size, (block + 1) * kBlock)};
}

std::size_t num_blocks(std::size_t size) { return (size + kBlock - 1) / kBlock; }

}  // namespace

Lbfgs::Lbfgs(int window)
    : window_(std::min(kMaxWindow, static_cast<std::size_t>(std::max(1, window)))),
      s_(window_ + 1),
      y_(window_ + 1),
      kernels_(outer_kernels(best_isa())) {
  const auto slots = static_cast<Eigen::Index>(window_ + 1);
  sy_ = Eigen::MatrixXd::Zero(slots, slots);
  s_dot_g_ = Eigen::VectorXd::Zero(slots);
}

void Lbfgs::restart() { order_.clear(); }

Lbfgs::Remembered Lbfgs::remembered(const std::vector<std::vector<float>>& rows) const {
  Remembered result;
  for (const std::size_t slot : order_)
    result.row[static_cast<std::size_t>(result.count++)] = rows[slot].data();
  return result;
}

Eigen::VectorXd Lbfgs::products(const std::vector<std::vector<float>>& rows,
                                const Positions& with) const {
  const auto size = static_cast<std::size_t>(with.size());
  const Remembered all = remembered(rows);
  const Sums sums = parallel_sum<Sums>(
      num_blocks(size),
      [&](std::size_t block) {
        const Range range = block_range(block, size);
        Sums part;
        kernels_.products({all.row.data(), all.count}, with.data(), range.begin, range.end,
                          part.value.data());
        return part;
      },
      1);
  return Eigen::Map<const Eigen::VectorXd>(sums.value.data(), all.count);
}

void Lbfgs::combine(const Positions& base, double factor,
                    const std::vector<std::vector<float>>& rows, const Eigen::VectorXd& weight,
                    Positions& out) const {
  out.resize(base.rows(), 3);
  const auto size = static_cast<std::size_t>(base.size());
  const Remembered all = remembered(rows);
  parallel_for(
      num_blocks(size),
      [&](std::size_t block) {
        const Range range = block_range(block, size);
        kernels_.combine(factor, base.data(), {all.row.data(), all.count}, weight.data(),
                         range.begin, range.end, out.data());
      },
      1);
}

void Lbfgs::propose(const Positions& g, Metric& metric, Positions& d) {
  const auto count = static_cast<Eigen::Index>(order_.size());
  Eigen::VectorXd alpha(count);
  for (Eigen::Index i = count; i-- > 0;) {
    alpha[i] = s_dot_g_[i];
    for (Eigen::Index j = i + 1; j < count; ++j) alpha[i] -= alpha[j] * sy_(i, j);
    alpha[i] /= sy_(i, i);
  }
  const Positions* right = &g;
  if (count > 0) {
    combine(g, 1, y_, -alpha, q_);
    right = &q_;
  }
  metric.apply(*right, d);
  const Eigen::VectorXd y_dot_d = products(y_, d);
  Eigen::VectorXd weight(count);  // of s in -d
  for (Eigen::Index i = 0; i < count; ++i) {
    double beta = y_dot_d[i];
    for (Eigen::Index j = 0; j < i; ++j) beta -= weight[j] * sy_(j, i);
    weight[i] = beta / sy_(i, i) - alpha[i];
  }
  combine(d, -1, s_, weight, d);
}

std::size_t Lbfgs::free_slot() const {
  std::size_t slot = 0;
  while (std::find(order_.begin(), order_.end(), slot) != order_.end()) ++slot;
  return slot;
}

void Lbfgs::forget(Eigen::Index i) {
  const Eigen::Index last = sy_.rows() - 1;
  order_.erase(order_.begin() + i);
  sy_.block(i, 0, last - i, last + 1) = sy_.block(i + 1, 0, last - i, last + 1).eval();
  sy_.block(0, i, last + 1, last - i) = sy_.block(0, i + 1, last + 1, last - i).eval();
  s_dot_g_.segment(i, last - i) = s_dot_g_.segment(i + 1, last - i).eval();
}

void Lbfgs::accept(double step, const Positions& d, const Positions& before,
                   const Positions& after) {
  const std::size_t slot = free_slot();
  const auto size = static_cast<std::size_t>(d.size());
  s_[slot].resize(size);
  y_[slot].resize(size);
  order_.push_back(slot);
  const Remembered all = remembered(s_);
  const Sums sums = parallel_sum<Sums>(
      num_blocks(size),
      [&](std::size_t block) {
        const Range range = block_range(block, size);
        kernels_.difference(step, d.data(), before.data(), after.data(), range.begin, range.end,
                            s_[slot].data(), y_[slot].data());
        Sums part;
        kernels_.two_products({all.row.data(), all.count}, y_[slot].data(), after.data(),
                              range.begin, range.end, part.value.data(),
                              part.value.data() + kMaxWindow + 1);
        return part;
      },
      1);
  const Eigen::Index newest = all.count - 1;
  for (Eigen::Index i = 0; i <= newest; ++i) {
    sy_(i, newest) = sums.value[static_cast<std::size_t>(i)];
    s_dot_g_[i] = sums.value[kMaxWindow + 1 + static_cast<std::size_t>(i)];
  }
  const double curvature = sy_(newest, newest);
  if (!(curvature > 0) || !std::isfinite(curvature))
    forget(newest);
  else if (order_.size() > window_)
    forget(0);
}

}  // namespace piecework::pd
