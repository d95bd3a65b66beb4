#pragma once

// When the iterations of a step end, and the numbers that say how well it is solved. Shared by
// every method, so that the columns of tables mean the same for all.

#include <cmath>
#include <deque>

#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::model {

/// Remaining error of an iteration from its increments (docs/architecture.md, D9):
///     2 max(1, q / (1 - q)) times the largest of the last three |dx|,
/// q their mean decay over up to eight iterations. Iterations with K^-1 alone start with increments
/// that fall fast, and what is left decays slowly: there the factor is at least sqrt(r) / 2, with
/// stiffness_ratio() r, a value between what was seen of L-BFGS and of plain iterations. Against
/// true errors of accelerated and plain iterations the median of estimate / error is 1 to 5, and
/// one in ten is below 1; a single ratio in the place of q is misled by every irregular step.
class ErrorEstimate {
 public:
  void add(double dx_inf);
  /// In the unit of the increments; infinite before two are known. \param least  of the factor
  [[nodiscard]] double value(double least) const;
  /// The same, but the first increment of a step is no witness of decay: it undoes the strain of
  /// the prediction, which on stiff cloth makes it larger than all that follow by orders.
  [[nodiscard]] double cautious_value(double least) const;
  /// Of increments of Newton's method: max(1, q / (1 - q)) |dx|, q the ratio of the last two. A
  /// projected second derivative converges linearly where cloth is compressed. And a linear system
  /// that is solved inexactly is solved for its stiffest part first: an increment that is suddenly
  /// small does not count as less than a quarter of the one before.
  [[nodiscard]] double newton_value() const;
  /// The error if the next increment would be `dx_inf`, but rounding does not let it be made.
  [[nodiscard]] double if_next(double dx_inf) const;
  /// q, at most 0.999; 1 before two increments are known.
  [[nodiscard]] double rate() const;

 private:
  static constexpr std::size_t kSpan = 8;
  std::deque<double> increments_;  ///< the last kSpan + 1
};

/// Measures one step's iterations. Per step: begin(), then measure_gradient() for the start, then
/// measure_increment(), measure_gradient() and reached() per iteration.
class Convergence {
 public:
  /// \param model    must outlive this object
  /// \param gravity  magnitude that turns forces into weights for `gradient`, m/s^2
  Convergence(const ClothModel& model, double gravity, StopOptions stop);

  /// A new step.
  void begin() {
    error_ = {};
    newton_ = false;
  }

  /// Increments are those of Newton's method: what is left after one is less than it was.
  void assume_newton(bool newton) { newton_ = newton; }

  /// Increments that come from K^-1 hide motion along the normals, which K resists
  /// `stiffness_ratio` times too much. 1: nothing is hidden.
  void assume_stiffness_ratio(double ratio) { hidden_ = 0.5 * std::sqrt(ratio); }

  /// Fills dx_2, dx_rms, dx_inf and error from x += T_f dx.
  void measure_increment(const Unknowns& dx, StepReport& report);

  /// The same from x += step T dx, with dx row-major.
  void measure_increment(const Positions& dx, double step, StepReport& report);

  /// The same from a displacement that was proposed in vain: it is what is left to do, as far as
  /// that is known. NaN if it is not finite.
  void measure_refused(const Positions& dx, StepReport& report);

  /// Fills gradient from grad E (|V| x 3, N).
  void measure_gradient(const Reduction& reduction, const Positions& gradient,
                        StepReport& report) const;

  /// The same from T^T grad E, n_f x 3.
  void measure_gradient(const Positions& reduced, StepReport& report) const;

  /// The stop rule holds, after min_iterations at the least.
  [[nodiscard]] bool reached(const StepReport& report) const;

  /// What the rule measures is within its tolerance, after however few iterations.
  [[nodiscard]] bool holds(const StepReport& report) const {
    return measure(report) <= stop_.tolerance;
  }

  /// The error is within the tolerance by the cautious estimate too.
  [[nodiscard]] bool surely_holds() const {
    return error_.cautious_value(hidden_) * unit_box_ / mean_edge_ <= stop_.tolerance;
  }

  /// Iterations until the stop rule holds, if they go on like the last ones; may be infinite.
  [[nodiscard]] double expected_iterations(const StepReport& report) const;

  /// Increments that matter to the stop rule, m: those below are small. 0: it asks for something
  /// else.
  [[nodiscard]] double small_increment() const {
    return stop_.rule == StopRule::Error ? stop_.tolerance * mean_edge_ : 0;
  }
  [[nodiscard]] const StopOptions& stop() const { return stop_; }
  /// Largest extent of the start shape, m (1 if it is a point): lengths of dx_2, dx_rms and dx_inf.
  [[nodiscard]] double unit_box() const { return unit_box_; }

 private:
  /// Fills dx_2, dx_rms and dx_inf.
  template <class RowSquare>
  void measure_length(std::size_t count, const RowSquare& row_sq, StepReport& report) const;
  template <class RowSquare>
  void measure_increment(std::size_t count, const RowSquare& row_sq, StepReport& report);
  template <class RowSquare>
  void measure_gradient(std::size_t count, const RowSquare& row_sq, StepReport& report) const;

  /// What the rule compares with its tolerance.
  [[nodiscard]] double measure(const StepReport& report) const;

  StopOptions stop_;
  double unit_box_;
  double mean_edge_;
  double nodal_weight_;  ///< mean over free vertices, N
  bool newton_ = false;
  double hidden_ = 0.5;  ///< least ratio of error to increment
  ErrorEstimate error_;
};

/// Mean over the vertices of K_vv / (m_v / h^2): how much stiffer than its inertia K is. At
/// least 1.
double stiffness_ratio(const ClothModel& model, const SparseMatrix& K, double h);

}  // namespace piecework::model
