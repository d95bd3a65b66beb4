#include <piecework/model/convergence.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <piecework/core/parallel.hpp>

namespace piecework::model {
namespace {

double largest_extent(const Positions& start) {
  const double extent = (start.colwise().maxCoeff() - start.colwise().minCoeff()).maxCoeff();
  return extent > 0 ? extent : 1.0;
}

}  // namespace

void ErrorEstimate::add(double dx_inf) {
  increments_.push_back(dx_inf);
  if (increments_.size() > kSpan + 1) increments_.pop_front();
}

double ErrorEstimate::rate() const {
  if (increments_.size() < 2) return 1;
  if (increments_.front() == 0) return increments_.back() == 0 ? 0 : 0.999;
  const auto span = static_cast<double>(increments_.size() - 1);
  return std::min(0.999, std::pow(increments_.back() / increments_.front(), 1 / span));
}

double ErrorEstimate::value(double least) const {
  if (!increments_.empty() && increments_.back() == 0) return 0;  // nothing is left to do
  if (increments_.size() < 2) return std::numeric_limits<double>::infinity();
  const auto recent = increments_.end() - std::min<std::ptrdiff_t>(3, std::ssize(increments_));
  const double q = rate();
  const double factor = std::max(2 * std::max(1.0, q / (1 - q)), least);
  return factor * *std::max_element(recent, increments_.end());
}

double ErrorEstimate::newton_value() const {
  constexpr double kSudden = 0.25;
  if (increments_.size() < 2) return std::numeric_limits<double>::infinity();
  const double last = increments_.back(), before = increments_[increments_.size() - 2];
  const double q = before > 0 ? std::min(0.99, last / before) : 0.99;
  return std::max(last, kSudden * before) * std::max(1.0, q / (1 - q));
}

double ErrorEstimate::cautious_value(double least) const {
  ErrorEstimate later;
  for (std::size_t i = 1; i < increments_.size(); ++i) later.add(increments_[i]);
  return std::max(value(least), later.value(least));
}

double ErrorEstimate::if_next(double dx_inf) const {
  const double q = increments_.size() < 2 ? 0.5 : rate();
  return 2 * std::max(1.0, q / (1 - q)) * dx_inf;
}

Convergence::Convergence(const ClothModel& model, double gravity, StopOptions stop)
    : stop_(stop),
      unit_box_(largest_extent(model.start)),
      mean_edge_(model.mean_edge),
      nodal_weight_(model.mass.sum() / static_cast<double>(model.num_free()) * gravity) {}

template <class RowSquare>
void Convergence::measure_length(std::size_t count, const RowSquare& row_sq,
                                 StepReport& report) const {
  const double sum_sq = parallel_sum<double>(count, row_sq);
  report.dx_2 = std::sqrt(sum_sq) / unit_box_;
  report.dx_rms = count > 0 ? std::sqrt(sum_sq / static_cast<double>(count)) / unit_box_ : 0;
  report.dx_inf = std::sqrt(parallel_max(count, row_sq)) / unit_box_;
}

template <class RowSquare>
void Convergence::measure_increment(std::size_t count, const RowSquare& row_sq,
                                    StepReport& report) {
  measure_length(count, row_sq, report);
  error_.add(report.dx_inf);
  const double left = newton_ ? error_.newton_value() : error_.value(hidden_);
  report.error = left * unit_box_ / mean_edge_;
}

void Convergence::measure_increment(const Unknowns& dx, StepReport& report) {
  measure_increment(
      static_cast<std::size_t>(dx.rows()),
      [&](std::size_t i) { return dx.row(static_cast<Eigen::Index>(i)).squaredNorm(); }, report);
}

void Convergence::measure_increment(const Positions& dx, double step, StepReport& report) {
  measure_increment(
      static_cast<std::size_t>(dx.rows()),
      [&](std::size_t i) {
        return step * step * dx.row(static_cast<Eigen::Index>(i)).squaredNorm();
      },
      report);
}

void Convergence::measure_refused(const Positions& dx, StepReport& report) {
  measure_length(
      static_cast<std::size_t>(dx.rows()),
      [&](std::size_t i) { return dx.row(static_cast<Eigen::Index>(i)).squaredNorm(); }, report);
  report.error = error_.if_next(report.dx_inf) * unit_box_ / mean_edge_;
}

template <class RowSquare>
void Convergence::measure_gradient(std::size_t count, const RowSquare& row_sq,
                                   StepReport& report) const {
  const double sum_sq = parallel_sum<double>(count, row_sq);
  report.gradient = count > 0 ? std::sqrt(sum_sq / static_cast<double>(count)) / nodal_weight_ : 0;
}

void Convergence::measure_gradient(const Reduction& reduction, const Positions& gradient,
                                   StepReport& report) const {
  measure_gradient(
      static_cast<std::size_t>(reduction.count()),
      [&](std::size_t i) { return reduction.row(gradient, static_cast<int>(i)).squaredNorm(); },
      report);
}

void Convergence::measure_gradient(const Positions& reduced, StepReport& report) const {
  measure_gradient(
      static_cast<std::size_t>(reduced.rows()),
      [&](std::size_t i) { return reduced.row(static_cast<Eigen::Index>(i)).squaredNorm(); },
      report);
}

double Convergence::measure(const StepReport& report) const {
  switch (stop_.rule) {
    case StopRule::Error:
      return report.error;
    case StopRule::Gradient:
      return report.gradient;
    case StopRule::Dx2:
      return report.dx_2;
    case StopRule::DxRms:
      return report.dx_rms;
    case StopRule::DxInf:
      return report.dx_inf;
    case StopRule::Iterations:
      break;
  }
  return std::numeric_limits<double>::infinity();
}

bool Convergence::reached(const StepReport& report) const {
  if (report.iterations < stop_.min_iterations) return false;
  if (stop_.rule == StopRule::Iterations) return report.iterations >= stop_.max_iterations;
  return holds(report);
}

double Convergence::expected_iterations(const StepReport& report) const {
  const double left = stop_.max_iterations - report.iterations;
  if (stop_.rule == StopRule::Iterations) return left;
  const double decay = -std::log(error_.rate());
  return std::min(left, std::max(0.0, std::log(measure(report) / stop_.tolerance) / decay));
}

double stiffness_ratio(const ClothModel& model, const SparseMatrix& K, double h) {
  const auto count = static_cast<std::size_t>(model.num_vertices());
  const Eigen::VectorXd diagonal = K.diagonal();
  const double sum = parallel_sum<double>(count, [&](std::size_t v) {
    const auto row = static_cast<Eigen::Index>(v);
    return diagonal[row] * h * h / model.mass[row];
  });
  return sum / static_cast<double>(count);
}

}  // namespace piecework::model
