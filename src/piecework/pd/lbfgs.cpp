#include "lbfgs.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <piecework/core/parallel.hpp>

namespace piecework::pd {
namespace {

constexpr std::size_t kBlock = 2048;  // numbers per step of a pass
constexpr std::size_t kMaxWindow = 32;

/// Sums of a pass, one per slot.
struct Sums {
  std::array<double, 2 * (kMaxWindow + 1)> value{};
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

/// Four sums that do not wait for each other.
template <class A, class B>
double product(const A* a, const B* b, Range range) {
  std::array<double, 8> sum{};
  std::size_t i = range.begin;
  for (; i + 8 <= range.end; i += 8)
    for (std::size_t k = 0; k < 8; ++k)
      sum[k] += static_cast<double>(a[i + k]) * static_cast<double>(b[i + k]);
  for (; i < range.end; ++i) sum[0] += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

}  // namespace

Lbfgs::Lbfgs(int window)
    : window_(std::min(kMaxWindow, static_cast<std::size_t>(std::max(1, window)))),
      s_(window_ + 1),
      y_(window_ + 1) {
  const auto slots = static_cast<Eigen::Index>(window_ + 1);
  sy_ = Eigen::MatrixXd::Zero(slots, slots);
  s_dot_g_ = Eigen::VectorXd::Zero(slots);
}

void Lbfgs::restart() { order_.clear(); }

Eigen::VectorXd Lbfgs::products(const std::vector<std::vector<float>>& rows,
                                const Positions& with) const {
  const auto size = static_cast<std::size_t>(with.size());
  const Sums sums = parallel_sum<Sums>(
      num_blocks(size),
      [&](std::size_t block) {
        Sums part;
        for (const std::size_t slot : order_)
          part.value[slot] = product(rows[slot].data(), with.data(), block_range(block, size));
        return part;
      },
      1);
  return Eigen::Map<const Eigen::VectorXd>(sums.value.data(), s_dot_g_.size());
}

void Lbfgs::combine(const Positions& base, double factor,
                    const std::vector<std::vector<float>>& rows, const Eigen::VectorXd& weight,
                    Positions& out) const {
  out.resize(base.rows(), 3);
  const auto size = static_cast<std::size_t>(base.size());
  parallel_for(
      num_blocks(size),
      [&](std::size_t block) {
        const Range range = block_range(block, size);
        for (std::size_t i = range.begin; i < range.end; ++i)
          out.data()[i] = factor * base.data()[i];
        for (const std::size_t slot : order_) {
          const double w = weight[static_cast<Eigen::Index>(slot)];
          const float* row = rows[slot].data();
          for (std::size_t i = range.begin; i < range.end; ++i)
            out.data()[i] += w * static_cast<double>(row[i]);
        }
      },
      1);
}

void Lbfgs::propose(const Positions& g, Metric& metric, Positions& d) {
  const auto sy = [&](std::size_t i, std::size_t j) {
    return sy_(static_cast<Eigen::Index>(order_[i]), static_cast<Eigen::Index>(order_[j]));
  };
  const auto count = order_.size();
  Eigen::VectorXd alpha = Eigen::VectorXd::Zero(s_dot_g_.size());
  const auto by_age = [&](Eigen::VectorXd& v, std::size_t i) -> double& {
    return v[static_cast<Eigen::Index>(order_[i])];
  };
  for (std::size_t i = count; i-- > 0;) {
    double value = by_age(s_dot_g_, i);
    for (std::size_t j = i + 1; j < count; ++j) value -= by_age(alpha, j) * sy(i, j);
    by_age(alpha, i) = value / sy(i, i);
  }
  if (count == 0) {
    metric.apply(g, d);
    combine(d, -1, s_, alpha, d);
    return;
  }
  combine(g, 1, y_, -alpha, q_);
  metric.apply(q_, d);
  Eigen::VectorXd y_dot_d = products(y_, d);
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(s_dot_g_.size());
  for (std::size_t i = 0; i < count; ++i) {
    double beta = by_age(y_dot_d, i);
    for (std::size_t j = 0; j < i; ++j) beta -= by_age(weight, j) * sy(j, i);
    by_age(weight, i) = beta / sy(i, i) - by_age(alpha, i);  // of -d
  }
  combine(d, -1, s_, weight, d);
}

std::size_t Lbfgs::free_slot() const {
  std::size_t slot = 0;
  while (std::find(order_.begin(), order_.end(), slot) != order_.end()) ++slot;
  return slot;
}

void Lbfgs::accept(double step, const Positions& d, const Positions& before,
                   const Positions& after) {
  const std::size_t slot = free_slot();
  const auto size = static_cast<std::size_t>(d.size());
  s_[slot].resize(size);
  y_[slot].resize(size);
  order_.push_back(slot);
  const Sums sums = parallel_sum<Sums>(
      num_blocks(size),
      [&](std::size_t block) {
        const Range range = block_range(block, size);
        for (std::size_t i = range.begin; i < range.end; ++i) {
          s_[slot][i] = static_cast<float>(step * d.data()[i]);
          y_[slot][i] = static_cast<float>(after.data()[i] - before.data()[i]);
        }
        Sums part;
        for (const std::size_t other : order_) {
          part.value[other] = product(s_[other].data(), y_[slot].data(), range);
          part.value[kMaxWindow + 1 + other] = product(s_[other].data(), after.data(), range);
        }
        return part;
      },
      1);
  for (const std::size_t other : order_) {
    sy_(static_cast<Eigen::Index>(other), static_cast<Eigen::Index>(slot)) = sums.value[other];
    s_dot_g_[static_cast<Eigen::Index>(other)] = sums.value[kMaxWindow + 1 + other];
  }
  if (!(sums.value[slot] > 0) || !std::isfinite(sums.value[slot]))
    order_.pop_back();
  else if (order_.size() > window_)
    order_.erase(order_.begin());
}

}  // namespace piecework::pd
