#include <piecework/global/diagonal_update.hpp>

#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

#include "column_sums.hpp"
#include "diagonal_methods.hpp"

namespace piecework::global {
namespace {

/// A run of CG that leaves more than this of the residual has met the end of its precision. Chosen.
constexpr double kStagnation = 0.5;

constexpr std::array<std::string_view, kNumDiagonalMethods> kNames = {
    "refactor", "pcg_last_factor", "adaptive",   "low_rank", "frozen_schur",
    "kinv_pcg", "woodbury_sd_pcg", "jacobi_pcg", "hybrid",   "dual"};

}  // namespace

std::string_view to_string(DiagonalMethod method) {
  return kNames[static_cast<std::size_t>(method)];
}

SolveStatus DiagonalUpdateSolver::prepare(const SparseMatrix& K, TreeSolver& tree) {
  K_ = &K;
  tree_ = &tree;
  if (tree.size() != K.rows())
    throw InputError(fmt::format("contact system: the factor has {} rows, the matrix {}",
                                 tree.size(), K.rows()));
  diagonal_ = Eigen::VectorXd::Zero(K.rows());
  inverse_ = K.diagonal().cwiseInverse();
  contacts_.clear();
  report_ = {};
  ready_ = false;
  return prepare_method();
}

SolveStatus DiagonalUpdateSolver::update(std::span<const double> diagonal) {
  if (static_cast<Eigen::Index>(diagonal.size()) != diagonal_.size())
    throw InputError(
        fmt::format("contact weights: {} given for {} rows", diagonal.size(), diagonal_.size()));
  for (std::size_t v = 0; v < diagonal.size(); ++v)
    if (!(diagonal[v] >= 0) || !std::isfinite(diagonal[v]))
      throw InputError(
          fmt::format("contact weights: row {} has {}; weights are finite and at least "
                      "0",
                      v, diagonal[v]));
  report_ = {};
  diagonal_ = Eigen::Map<const Eigen::VectorXd>(diagonal.data(), diagonal_.size());
  inverse_ = (K_->diagonal() + diagonal_).cwiseInverse();
  contacts_.clear();
  for (Eigen::Index v = 0; v < diagonal_.size(); ++v)
    if (diagonal_[v] > 0) contacts_.push_back(static_cast<int>(v));
  const SolveStatus status = update_method();
  ready_ = status == SolveStatus::Ok;
  return status;
}

Eigen::RowVector3d DiagonalUpdateSolver::elastic_row(const Positions& p, int v) const {
  Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
  for (SparseMatrix::InnerIterator entry(*K_, v); entry; ++entry)  // column v is row v
    sum += entry.value() * p.row(entry.row());
  return sum;
}

void DiagonalUpdateSolver::multiply(const Positions& p, Positions& y) const {
  y.resize(p.rows(), 3);
  for_each_row(p.rows(), [&](Eigen::Index v) {
    y.row(v) = elastic_row(p, static_cast<int>(v)) + diagonal_[v] * p.row(v);
  });
}

void DiagonalUpdateSolver::apply_inverse(const Positions& r, Positions& z) {
  z.resize(r.rows(), 3);
  [[maybe_unused]] const SolveStatus status = tree_->solve(r.data(), z.data(), 3, 3, 1);
  PIECEWORK_ASSERT(status == SolveStatus::Ok);
  ++report_.applications;
}

double DiagonalUpdateSolver::measure(const Positions& r) const {
  const double largest = parallel_max(static_cast<std::size_t>(r.rows()), [&](std::size_t i) {
    const auto v = static_cast<Eigen::Index>(i);
    return r.row(v).lpNorm<Eigen::Infinity>() * inverse_[v] + 0 * r.row(v).sum();  // keeps NaN
  });
  return largest / scale_;
}

bool DiagonalUpdateSolver::go_on(const Positions& x, const Positions& r,
                                 const DiagonalLimits& limits) {
  ++report_.iterations;
  report_.residual = measure(r);
  if (limits.observer && !limits.observer(report_.iterations, x)) {
    report_.status = DiagonalStatus::Stopped;
    return false;
  }
  return report_.residual > limits.tolerance && report_.iterations < limits.max_iterations;
}

/// Preconditioned CG, each column with its own steps. beta in the form of Polak and Ribiere, which
/// forgives a preconditioner that is symmetric to 32 bits only.
void DiagonalUpdateSolver::iterate(Positions& x, Positions& r, const DiagonalLimits& limits) {
  precondition(r, z_);
  p_ = z_;
  Eigen::Array<double, 1, 3> zr = column_dots(z_, r);
  while (true) {
    multiply(p_, Ap_);
    const Eigen::Array<double, 1, 3> pAp = column_dots(p_, Ap_);
    const Eigen::Array<double, 1, 3> alpha = safe_ratio(zr, pAp);
    if ((alpha == 0).all()) return;
    for_each_row(x.rows(), [&](Eigen::Index v) {
      x.row(v).array() += alpha * p_.row(v).array();
      r.row(v).array() -= alpha * Ap_.row(v).array();
    });
    if (!go_on(x, r, limits)) return;
    precondition(r, z_);
    const Eigen::Array<double, 1, 3> beta = safe_ratio(-column_dots(z_, Ap_), pAp);
    zr = column_dots(z_, r);
    for_each_row(x.rows(),
                 [&](Eigen::Index v) { p_.row(v) = z_.row(v).array() + beta * p_.row(v).array(); });
  }
}

DiagonalReport DiagonalUpdateSolver::solve(const Positions& b, Positions& x,
                                           const DiagonalLimits& limits) {
  const Eigen::Index rows = diagonal_.size();
  if (b.rows() != rows || x.rows() != rows)
    throw InputError(fmt::format("contact system: {} rows of b and {} of x for a matrix of {}",
                                 b.rows(), x.rows(), rows));
  if (ready_) run(b, x, limits);
  last_iterations_ = report_.iterations;
  return std::exchange(report_, DiagonalReport{});
}

/// Runs of the method, each from the true residual, until that is met or a run gains nothing.
void DiagonalUpdateSolver::run(const Positions& b, Positions& x, const DiagonalLimits& limits) {
  scale_ = 1;
  scale_ = measure(b);
  if (scale_ == 0) {
    x.setZero();
    report_.status = DiagonalStatus::Converged;
    return;
  }
  start(b, x);
  report_.status = DiagonalStatus::NotConverged;
  if (limits.observer && !limits.observer(0, x)) report_.status = DiagonalStatus::Stopped;
  double before = std::numeric_limits<double>::infinity();
  while (report_.status == DiagonalStatus::NotConverged) {
    multiply(x, residual_);
    for_each_row(x.rows(), [&](Eigen::Index v) { residual_.row(v) = b.row(v) - residual_.row(v); });
    report_.residual = measure(residual_);
    if (report_.residual <= limits.tolerance) {
      report_.status = DiagonalStatus::Converged;
      return;
    }
    const bool progress = report_.residual < kStagnation * before;  // false for NaN
    if (report_.iterations >= limits.max_iterations || !progress) return;
    before = report_.residual;
    iterate(x, residual_, limits);
  }
}

std::unique_ptr<DiagonalUpdateSolver> make_diagonal_solver(DiagonalMethod method,
                                                           const DiagonalOptions& options) {
  switch (method) {
    case DiagonalMethod::Refactor:
    case DiagonalMethod::LastFactor:
    case DiagonalMethod::Adaptive:
      return make_factor_update(method, options);
    case DiagonalMethod::LowRank:
      return make_low_rank_update(options);
    case DiagonalMethod::FrozenSchur:
      return make_frozen_schur(options);
    case DiagonalMethod::InverseK:
      return make_inverse_k(false, options);
    case DiagonalMethod::SteepestDescent:
      return make_inverse_k(true, options);
    case DiagonalMethod::Jacobi:
      return make_jacobi();
    case DiagonalMethod::Hybrid:
      return make_hybrid();
    case DiagonalMethod::Dual:
      return make_dual();
  }
  throw InputError("contact solver: unknown method");
}

}  // namespace piecework::global
