#include <piecework/pd/inexact_newton.hpp>

#include <algorithm>
#include <cmath>

#include <piecework/core/parallel.hpp>
#include <piecework/pd/acceleration.hpp>

namespace piecework::pd {
namespace {

/// The residual that is left of the linear system as a rule...
constexpr double kLoosest = 0.5, kTightest = 0.1;
/// ... and if the increment is small. Under stiff contact the residual is all pressing: with a
/// tenth of it left, cloth has hardly begun to slide, and would be taken for converged.
constexpr double kSmall = 0.03;
/// Iterations in the metric, in prices of a factor of H, until that is worth it. More than one, as
/// each direction in the rest of the step needs a factor of its own.
constexpr double kPrices = 6;

/// Numbers per task.
constexpr std::size_t kChunk = 4096;

/// Calls body(begin, size) for parts of vectors as long as a.
template <class Body>
void for_chunks(const Positions& a, const Body& body) {
  const auto size = static_cast<std::size_t>(a.size());
  parallel_for((size + kChunk - 1) / kChunk,
               [&](std::size_t c) {
                 body(static_cast<Eigen::Index>(c * kChunk),
                      static_cast<Eigen::Index>(std::min(kChunk, size - c * kChunk)));
               },
               1);
}

Eigen::Map<Eigen::ArrayXd> part(Positions& a, Eigen::Index begin, Eigen::Index size) {
  return {a.data() + begin, size};
}
Eigen::Map<const Eigen::ArrayXd> part(const Positions& a, Eigen::Index begin, Eigen::Index size) {
  return {a.data() + begin, size};
}

/// d += step p and r -= step q.
void advance(double step, const Positions& p, const Positions& q, Positions& d, Positions& r) {
  for_chunks(d, [&](Eigen::Index begin, Eigen::Index size) {
    part(d, begin, size) += step * part(p, begin, size);
    part(r, begin, size) -= step * part(q, begin, size);
  });
}

/// a = b + factor a.
void add_onto(Positions& a, double factor, const Positions& b) {
  for_chunks(a, [&](Eigen::Index begin, Eigen::Index size) {
    part(a, begin, size) = part(b, begin, size) + factor * part(a, begin, size);
  });
}

}  // namespace

void InexactNewton::reset() {
  reduction_ = nullptr;
  if (factor_) factor_->reset();
}

void InexactNewton::begin() {
  last_norm_sq_ = 0;
  factored_ = false;
  factors_ = true;
}

void InexactNewton::assemble(const Positions& x, const model::StepProblem& problem,
                             const Metric& metric, const model::ContactTerms* contact) {
  if (!reduction_) {
    reduction_ = &metric.reduction();
    hessian_.set_pattern(*reduction_, reduction_->system(metric.K()));
    cloth_.set_pattern(hessian_);
    price_ = kPrices * HessianFactor::price(metric.solver().report(), cloth_);
  }
  hessian_.evaluate(x, problem, model::HessianForm::Projected);
  cloth_.take(hessian_);
  blocks_.clear();
  if (contact) contact->hessian(blocks_);
  contact_.take(blocks_, model_, *reduction_);
}

void InexactNewton::multiply(const Positions& d, Positions& product) {
  cloth_.multiply(d, product);
  contact_.add(d, product);
}

/// Tighter as the gradient falls faster, which says that the second derivative is believed to the
/// end [Eisenstat and Walker 1996, choice 2]. In the norm of the metric: the plain one is not
/// monotone.
double InexactNewton::forcing(double norm_sq) {
  const double ratio_sq = last_norm_sq_ > 0 ? norm_sq / last_norm_sq_ : 1;
  last_norm_sq_ = norm_sq;
  return std::clamp(0.9 * ratio_sq, kTightest, kLoosest);
}

bool InexactNewton::factor() {
  if (!factor_) factor_ = std::make_unique<HessianFactor>();
  factored_ = factors_ = factor_->factor(hessian_, blocks_, model_, *reduction_);
  return factored_;
}

void InexactNewton::precondition(Metric& metric) {
  if (factored_)
    factor_->apply(residual_, preconditioned_);
  else
    metric.apply(residual_, preconditioned_);
}

int InexactNewton::solve(const Positions& g, double small, Metric& metric, Positions& d) {
  if (factored_) factor();
  d.setZero(g.rows(), 3);
  residual_ = -g;
  double norm_sq = 0, tight = 0, enough = 0;
  const auto begin = [&] {
    precondition(metric);
    direction_ = preconditioned_;
    norm_sq = dot(residual_, preconditioned_);
    tight = kSmall * kSmall * norm_sq;
    enough = std::pow(forcing(norm_sq), 2) * norm_sq;
  };
  begin();
  int iterations = 0;
  while (iterations < kMaxIterations && norm_sq > tight) {
    if (norm_sq <= enough) {
      if (longest(d) > small) break;
      enough = tight;
    }
    if (!factored_ && factors_ && iterations >= price_ && factor()) begin();
    multiply(direction_, product_);
    const double curvature = dot(direction_, product_);
    if (!(curvature > 0)) break;  // only rounding is left
    const double step = norm_sq / curvature;
    advance(step, direction_, product_, d, residual_);
    ++iterations;
    precondition(metric);
    const double next_sq = dot(residual_, preconditioned_);
    add_onto(direction_, next_sq / norm_sq, preconditioned_);
    norm_sq = next_sq;
  }
  if (iterations == 0) d = direction_;
  return iterations;
}

}  // namespace piecework::pd
