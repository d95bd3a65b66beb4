#pragma once

// When the iterations of a step end, and the numbers that say how well it is solved. Shared by
// every method, so that the columns of tables mean the same for all.

#include <deque>

#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::model {

/// Remaining error of a linearly converging iteration, from the decay of its increments:
/// q / (1 - q) |dx|, q the largest of the last three ratios (docs/architecture.md, D9).
class ErrorEstimate {
 public:
  void add(double dx_inf);
  /// In the unit of the increments; infinite before three ratios are known.
  [[nodiscard]] double value() const;

 private:
  static constexpr std::size_t kRatios = 3;
  double last_ = 0;
  std::deque<double> ratios_;
};

/// Measures one step's iterations. Per step: begin(), then measure_gradient() for the start, then
/// measure_increment(), measure_gradient() and reached() per iteration.
class Convergence {
 public:
  /// \param model    must outlive this object
  /// \param gravity  magnitude that turns forces into weights for `gradient`, m/s^2
  Convergence(const ClothModel& model, double gravity, StopOptions stop);

  /// A new step.
  void begin() { error_ = {}; }

  /// Fills dx_2, dx_rms, dx_inf and error from x += T_f dx.
  void measure_increment(const Unknowns& dx, StepReport& report);

  /// Fills gradient from grad E (|V| x 3, N).
  void measure_gradient(const Reduction& reduction, const Positions& gradient,
                        StepReport& report) const;

  /// The stop rule holds.
  [[nodiscard]] bool reached(const StepReport& report) const;

  [[nodiscard]] const StopOptions& stop() const { return stop_; }
  /// Largest extent of the start shape, m (1 if it is a point): lengths of dx_2, dx_rms and dx_inf.
  [[nodiscard]] double unit_box() const { return unit_box_; }

 private:
  StopOptions stop_;
  double unit_box_;
  double mean_edge_;
  double nodal_weight_;  ///< mean over free vertices, N
  ErrorEstimate error_;
};

}  // namespace piecework::model
