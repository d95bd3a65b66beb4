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
  if (last_ > 0) ratios_.push_back(dx_inf / last_);
  if (ratios_.size() > kRatios) ratios_.pop_front();
  last_ = dx_inf;
}

double ErrorEstimate::value() const {
  if (last_ == 0) return 0;
  // Early increments fall fast, before the slow modes are all that is left: too few ratios flatter.
  if (ratios_.size() < kRatios) return std::numeric_limits<double>::infinity();
  const double q = std::min(0.999, *std::max_element(ratios_.begin(), ratios_.end()));
  return q / (1.0 - q) * last_;
}

Convergence::Convergence(const ClothModel& model, double gravity, StopOptions stop)
    : stop_(stop),
      unit_box_(largest_extent(model.start)),
      mean_edge_(model.mean_edge),
      nodal_weight_(model.mass.sum() / static_cast<double>(model.num_free()) * gravity) {}

void Convergence::measure_increment(const Unknowns& dx, StepReport& report) {
  const auto count = static_cast<std::size_t>(dx.rows());
  const auto row_sq = [&](std::size_t i) {
    return dx.row(static_cast<Eigen::Index>(i)).squaredNorm();
  };
  const double sum_sq = parallel_sum<double>(count, row_sq);
  report.dx_2 = std::sqrt(sum_sq) / unit_box_;
  report.dx_rms = count > 0 ? std::sqrt(sum_sq / static_cast<double>(count)) / unit_box_ : 0;
  report.dx_inf = std::sqrt(parallel_max(count, row_sq)) / unit_box_;
  error_.add(report.dx_inf);
  report.error = error_.value() * unit_box_ / mean_edge_;
}

void Convergence::measure_gradient(const Reduction& reduction, const Positions& gradient,
                                   StepReport& report) const {
  const auto count = static_cast<std::size_t>(reduction.count());
  const double sum_sq = parallel_sum<double>(count, [&](std::size_t i) {
    return reduction.row(gradient, static_cast<int>(i)).squaredNorm();
  });
  report.gradient = count > 0 ? std::sqrt(sum_sq / static_cast<double>(count)) / nodal_weight_ : 0;
}

bool Convergence::reached(const StepReport& report) const {
  if (report.iterations < stop_.min_iterations) return false;
  switch (stop_.rule) {
    case StopRule::Error:
      return report.error <= stop_.tolerance;
    case StopRule::Gradient:
      return report.gradient <= stop_.tolerance;
    case StopRule::Dx2:
      return report.dx_2 <= stop_.tolerance;
    case StopRule::DxRms:
      return report.dx_rms <= stop_.tolerance;
    case StopRule::DxInf:
      return report.dx_inf <= stop_.tolerance;
    case StopRule::Iterations:
      return report.iterations >= stop_.max_iterations;
  }
  return false;
}

}  // namespace piecework::model
