#pragma once

// L-BFGS with the metric P as initial inverse Hessian.

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <piecework/pd/acceleration.hpp>

#include "kernels.hpp"

namespace piecework::pd {

/// The two-loop recursion [Nocedal 1980] on inner products: each loop reads the remembered vectors
/// once, in one pass, since what its steps need of each other are the numbers s_i . y_j. Remembered
/// vectors are kept in 32 bits: they shape the path, not the end.
class Lbfgs final : public Acceleration {
 public:
  static constexpr std::size_t kMaxWindow = 32;

  explicit Lbfgs(int window);

  void restart() override;
  /// Pairs (s, y) tell of E, not of P.
  void metric_changed() override {}
  void propose(const Positions& g, Metric& metric, Positions& d) override;
  /// Without s . y > 0 the pair is left out: the approximation stays positive definite.
  void accept(double step, const Positions& d, const Positions& before,
              const Positions& after) override;
  [[nodiscard]] bool fresh() const override { return order_.empty(); }
  [[nodiscard]] bool scalable() const override { return true; }

 private:
  /// Remembered vectors, oldest first.
  struct Remembered {
    std::array<const float*, kMaxWindow + 1> row{};
    int count = 0;
  };

  [[nodiscard]] std::size_t free_slot() const;
  /// Drops the i-th oldest pair.
  void forget(Eigen::Index i);
  [[nodiscard]] Remembered remembered(const std::vector<std::vector<float>>& rows) const;
  [[nodiscard]] Eigen::VectorXd products(const std::vector<std::vector<float>>& rows,
                                         const Positions& with) const;
  void combine(const Positions& base, double factor, const std::vector<std::vector<float>>& rows,
               const Eigen::VectorXd& weight, Positions& out) const;

  std::size_t window_;
  std::vector<std::vector<float>> s_, y_;  ///< per slot (one more than the window), 3 n_f numbers
  std::vector<std::size_t> order_;         ///< slots, oldest first
  Eigen::MatrixXd sy_;                     ///< s_i . y_j, by age, for i not newer than j
  Eigen::VectorXd s_dot_g_;                ///< by age, with the newest gradient
  Positions q_;
  const OuterKernels& kernels_;
};

}  // namespace piecework::pd
