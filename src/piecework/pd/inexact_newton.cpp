#include <piecework/pd/inexact_newton.hpp>

#include <algorithm>
#include <cmath>

#include <piecework/core/parallel.hpp>
#include <piecework/pd/acceleration.hpp>

namespace piecework::pd {
namespace {

/// The residual that is left of the linear system.
constexpr double kLoosest = 0.5, kTightest = 0.1;

double longest(const Positions& d) {
  return std::sqrt(parallel_max(static_cast<std::size_t>(d.rows()), [&](std::size_t i) {
    return d.row(static_cast<Eigen::Index>(i)).squaredNorm();
  }));
}

/// a += factor b.
void add(Positions& a, double factor, const Positions& b) {
  parallel_for(static_cast<std::size_t>(a.rows()), [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    a.row(row) += factor * b.row(row);
  });
}

/// a = b + factor a.
void add_onto(Positions& a, double factor, const Positions& b) {
  parallel_for(static_cast<std::size_t>(a.rows()), [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    a.row(row) = b.row(row) + factor * a.row(row);
  });
}

}  // namespace

void InexactNewton::assemble(const Positions& x, const model::StepProblem& problem,
                             const Metric& metric, const model::ContactTerms* contact) {
  if (!reduction_) {
    reduction_ = &metric.reduction();
    hessian_.set_pattern(*reduction_, reduction_->system(metric.K()));
  }
  hessian_.assemble(x, problem, model::HessianForm::Projected);
  blocks_.clear();
  if (contact) contact->hessian(blocks_);
}

void InexactNewton::add_contact(const Positions& d, Positions& product) {
  moved_.setZero(model_.num_vertices(), 3);
  reduction_->advance(moved_, 1, d, force_);  // T_f d
  std::swap(moved_, force_);
  force_.setZero(model_.num_vertices(), 3);
  for (const model::ContactBlock& block : blocks_) {
    Vec3 relative = Vec3::Zero();
    for (int k = 0; k < block.count; ++k)
      relative += block.beta[static_cast<std::size_t>(k)] *
                  moved_.row(block.vertices[static_cast<std::size_t>(k)]).transpose();
    const Eigen::RowVector3d force = (block.stiffness * relative).transpose();
    for (int k = 0; k < block.count; ++k)
      force_.row(block.vertices[static_cast<std::size_t>(k)]) +=
          block.beta[static_cast<std::size_t>(k)] * force;
  }
  reduction_->gather(force_, folded_);
  add(product, 1, folded_);
}

void InexactNewton::multiply(const Positions& d, Positions& product) {
  hessian_.multiply_rounded(d, product);
  if (!blocks_.empty()) add_contact(d, product);
}

/// Tighter as the gradient falls faster, which says that the second derivative is believed to the
/// end [Eisenstat and Walker 1996, choice 2]. In the norm of the metric: the plain one is not
/// monotone.
double InexactNewton::forcing(double norm_sq) {
  const double ratio_sq = last_norm_sq_ > 0 ? norm_sq / last_norm_sq_ : 1;
  last_norm_sq_ = norm_sq;
  return std::clamp(0.9 * ratio_sq, kTightest, kLoosest);
}

int InexactNewton::solve(const Positions& g, double small, Metric& metric, Positions& d) {
  d.setZero(g.rows(), 3);
  residual_ = -g;
  metric.apply(residual_, preconditioned_);
  direction_ = preconditioned_;
  double norm_sq = dot(residual_, preconditioned_);
  const double tight = kTightest * kTightest * norm_sq;
  double enough = std::pow(forcing(norm_sq), 2) * norm_sq;
  int iterations = 0;
  while (iterations < kMaxIterations && norm_sq > tight) {
    if (norm_sq <= enough) {
      if (longest(d) > small) break;
      enough = tight;
    }
    multiply(direction_, product_);
    const double curvature = dot(direction_, product_);
    if (!(curvature > 0)) break;  // only rounding is left
    const double step = norm_sq / curvature;
    add(d, step, direction_);
    add(residual_, -step, product_);
    ++iterations;
    metric.apply(residual_, preconditioned_);
    const double next_sq = dot(residual_, preconditioned_);
    add_onto(direction_, next_sq / norm_sq, preconditioned_);
    norm_sq = next_sq;
  }
  if (iterations == 0) d = direction_;
  return iterations;
}

}  // namespace piecework::pd
