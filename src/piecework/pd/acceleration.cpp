#include <piecework/pd/acceleration.hpp>

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <piecework/core/parallel.hpp>

#include "lbfgs.hpp"

namespace piecework::pd {
namespace {

/// d = -P g.
void descend(const Positions& g, Metric& metric, Positions& d) {
  metric.apply(g, d);
  parallel_for(static_cast<std::size_t>(d.rows()),
               [&](std::size_t i) { d.row(static_cast<Eigen::Index>(i)) *= -1; });
}

class Plain final : public Acceleration {
 public:
  void restart() override {}
  void propose(const Positions& g, Metric& metric, Positions& d) override { descend(g, metric, d); }
  void accept(double, const Positions&, const Positions&, const Positions&) override {}
  [[nodiscard]] bool fresh() const override { return true; }
};

/// x_{k+1} = omega (x_k + f_k - x_{k-1}) + x_{k-1}, f = -P g [Wang 2015, Eqs. 9 and 10].
class Chebyshev final : public Acceleration {
 public:
  explicit Chebyshev(double rho) : rho_(rho) {}

  void restart() override { count_ = 0; }
  void propose(const Positions& g, Metric& metric, Positions& d) override {
    descend(g, metric, d);
    if (count_ < kDelay) return;
    omega_ = count_ == kDelay ? 2 / (2 - rho_ * rho_) : 4 / (4 - rho_ * rho_ * omega_);
    parallel_for(static_cast<std::size_t>(d.rows()), [&](std::size_t i) {
      const auto row = static_cast<Eigen::Index>(i);
      d.row(row) = omega_ * d.row(row) + (omega_ - 1) * last_.row(row);
    });
  }
  void accept(double, const Positions& d, const Positions&, const Positions&) override {
    last_ = d;
    ++count_;
  }
  [[nodiscard]] bool fresh() const override { return count_ < kDelay; }

 private:
  static constexpr int kDelay = 2;  // plain steps before the sequence is regular enough
  double rho_, omega_ = 1;
  int count_ = 0;
  Positions last_;
};

/// x_{k+1} = x_k + f_k - (dX + dF) theta, theta = argmin |f_k - dF theta| [Peng et al. 2018].
class Anderson final : public Acceleration {
 public:
  explicit Anderson(int window) : window_(static_cast<std::size_t>(window)) {}

  void restart() override {
    dx_.clear();
    df_.clear();
    have_f_ = false;
  }

  void propose(const Positions& g, Metric& metric, Positions& d) override {
    descend(g, metric, d);
    if (have_f_) {
      df_.push_back(d - f_);
      dx_.push_back(moved_);
      if (df_.size() > window_) {
        df_.pop_front();
        dx_.pop_front();
      }
    }
    f_ = d;
    if (!df_.empty()) mix(d);
  }

  void accept(double step, const Positions& d, const Positions&, const Positions&) override {
    moved_ = step * d;
    have_f_ = true;
  }
  [[nodiscard]] bool fresh() const override { return !have_f_; }

 private:
  void mix(Positions& d) const {
    const auto count = static_cast<Eigen::Index>(df_.size());
    Eigen::MatrixXd gram(count, count);
    Eigen::VectorXd right(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      right[i] = dot(df_[static_cast<std::size_t>(i)], f_);
      for (Eigen::Index j = 0; j <= i; ++j)
        gram(i, j) = gram(j, i) =
            dot(df_[static_cast<std::size_t>(i)], df_[static_cast<std::size_t>(j)]);
    }
    gram.diagonal() *= 1 + 1e-12;  // old differences may repeat each other
    const Eigen::VectorXd theta = gram.ldlt().solve(right);
    if (!theta.allFinite()) return;
    parallel_for(static_cast<std::size_t>(d.rows()), [&](std::size_t i) {
      const auto row = static_cast<Eigen::Index>(i);
      for (std::size_t k = 0; k < df_.size(); ++k)
        d.row(row) -= theta[static_cast<Eigen::Index>(k)] * (dx_[k].row(row) + df_[k].row(row));
    });
  }

  std::size_t window_;
  std::deque<Positions> dx_, df_;
  Positions f_, moved_;
  bool have_f_ = false;
};

}  // namespace

double dot(const Positions& a, const Positions& b) {
  constexpr std::size_t kBlock = 4096;
  static const OuterKernels& kernels = outer_kernels(best_isa());
  const auto size = static_cast<std::size_t>(a.size());
  return parallel_sum<double>((size + kBlock - 1) / kBlock,
                              [&](std::size_t block) {
                                return kernels.dot(a.data(), b.data(), block * kBlock,
                                                   std::min(size, (block + 1) * kBlock));
                              },
                              1);
}

double longest(const Positions& d) {
  return std::sqrt(parallel_max(static_cast<std::size_t>(d.rows()), [&](std::size_t i) {
    return d.row(static_cast<Eigen::Index>(i)).squaredNorm();
  }));
}

std::string to_string(const AccelerationOptions& options) {
  switch (options.kind) {
    case AccelerationKind::None:
      return "not accelerated";
    case AccelerationKind::Chebyshev:
      return fmt::format("Chebyshev, rho {:g}", options.rho);
    case AccelerationKind::Anderson:
      return fmt::format("Anderson of {} iterates", options.window);
    case AccelerationKind::Lbfgs:
      return fmt::format("L-BFGS of {} pairs", options.window);
  }
  return "";
}

std::unique_ptr<Acceleration> make_acceleration(const AccelerationOptions& options) {
  switch (options.kind) {
    case AccelerationKind::None:
      return std::make_unique<Plain>();
    case AccelerationKind::Chebyshev:
      return std::make_unique<Chebyshev>(options.rho);
    case AccelerationKind::Anderson:
      return std::make_unique<Anderson>(options.window);
    case AccelerationKind::Lbfgs:
      return std::make_unique<Lbfgs>(options.window);
  }
  return nullptr;
}

}  // namespace piecework::pd
