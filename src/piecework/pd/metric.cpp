#include <piecework/pd/metric.hpp>

#include <algorithm>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/global/eigen_views.hpp>

namespace piecework::pd {
namespace {

/// Kn is soft where cloth swings freely: there only inertia is left of it. In 32 bits that is lost
/// in the rounding of the stiffest entries if it is below them by more than this, and what is
/// factored then is noise, positive definite or not.
constexpr double kMostOf32Bits = 1e8;

/// Stiffest diagonal entry over the least inertia, which is what the rows of K sum to.
double dynamic_range(const SparseMatrix& K) {
  const Eigen::VectorXd inertia = K * Eigen::VectorXd::Ones(K.cols());
  const double least = inertia.size() > 0 ? inertia.minCoeff() : 1.0;
  return least > 0 ? K.diagonal().maxCoeff() / least : std::numeric_limits<double>::infinity();
}

/// K~ + D is factored where contact is stiffer than this fraction of K~'s diagonal.
constexpr double kWorthFactoring = 0.1;

/// A metric only shapes the path to the minimum: 32 bits do, and their error is not estimated.
global::TreeOptions normal_options(const SparseMatrix& K) {
  if (dynamic_range(K) > kMostOf32Bits) return {};
  return {.precision = global::Precision::Single, .factor_in_single = true, .contraction_limit = 0};
}

}  // namespace

Metric::Metric(const model::ClothModel& model, SparseMatrix K,
               std::unique_ptr<global::ExactSolver> solver, const ContactSolve& contact_solve)
    : model_(model),
      K_(std::move(K)),
      solver_(std::move(solver)),
      normal_solver_(normal_options(K_)),
      contact_solver_(normal_options(K_)),
      contact_solve_(contact_solve) {}

Metric::~Metric() = default;

void Metric::prepare(const std::vector<char>& fixed) {
  normals_in_use_ = contact_in_use_ = contact_analysed_ = false;
  normal_.reset();
  diagonal_.reset();
  reduction_ = model::Reduction(model_, fixed);
  reduced_ = reduction_.system(K_);
  const auto status = solver_->factor(reduced_, reduction_.vertices());
  global::require_factor(status, reduction_.count());
}

global::TreeSolver* Metric::stretch_tree() {
  if (contact_in_use_ && diagonal_) return nullptr;
  return contact_in_use_ ? &contact_solver_ : solver_->tree();
}

/// Of unknowns, from what contact says of vertices.
void Metric::find_contact(const model::ContactTerms& contact) {
  const auto count = static_cast<std::size_t>(model_.num_vertices());
  vertex_normals_.setZero(model_.num_vertices(), 3);
  if (normal_) {
    parallel_for(count, [&](std::size_t v) {
      Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
      model_.sewing.map().visit_carriers(static_cast<int>(v), [&](int carrier, double weight) {
        const int unknown = reduction_.number(carrier);
        if (unknown >= 0) sum += weight * normal_->normals().row(unknown);
      });
      const double length = sum.norm();
      if (length > 0) vertex_normals_.row(static_cast<Eigen::Index>(v)) = sum / length;
    });
  }
  contact.stiffness(vertex_normals_, contact_);
  // |sum_c w_c u_c|^2 <= sum_c w_c |u_c|^2: what holds a slave holds its carriers by their weights.
  Positions packed(model_.num_vertices(), 3);
  packed << contact_.along, contact_.across, Eigen::VectorXd::Zero(model_.num_vertices());
  along_.resize(reduction_.count());
  across_.resize(reduction_.count());
  parallel_for(static_cast<std::size_t>(reduction_.count()), [&](std::size_t i) {
    const Eigen::RowVector3d sum = reduction_.row(packed, static_cast<int>(i));
    along_[static_cast<Eigen::Index>(i)] = sum[0];
    across_[static_cast<Eigen::Index>(i)] = sum[1];
  });
}

void Metric::factor_anew(const Eigen::VectorXd& D) {
  if (!contact_analysed_) {
    if (const global::TreeSolver* tree = solver_->tree())
      contact_solver_.share_analysis(*tree);
    else
      contact_solver_.analyze(global::pattern_of(reduced_));
    contact_analysed_ = true;
  }
  contact_values_.assign(reduced_.valuePtr(), reduced_.valuePtr() + reduced_.nonZeros());
  parallel_for(static_cast<std::size_t>(reduced_.cols()), [&](std::size_t column) {
    const int* first = reduced_.innerIndexPtr() + reduced_.outerIndexPtr()[column];
    const int* last = reduced_.innerIndexPtr() + reduced_.outerIndexPtr()[column + 1];
    const int* entry = std::lower_bound(first, last, static_cast<int>(column));
    contact_values_[static_cast<std::size_t>(entry - reduced_.innerIndexPtr())] +=
        D[static_cast<Eigen::Index>(column)];
  });
  contact_in_use_ = contact_solver_.factor(contact_values_) == global::SolveStatus::Ok;
}

bool Metric::factor_with(const Eigen::VectorXd& D) {
  contact_in_use_ = false;
  if (D.size() == 0 || !((D.array() > kWorthFactoring * reduced_.diagonal().array()).any()))
    return true;
  if (contact_solve_.method == global::DiagonalMethod::Refactor) {
    factor_anew(D);
    return contact_in_use_;
  }
  if (!diagonal_) {
    diagonal_ = global::make_diagonal_solver(contact_solve_.method, contact_solve_.options);
    if (diagonal_->prepare(reduced_, *solver_->tree()) != global::SolveStatus::Ok) return false;
  }
  contact_in_use_ =
      diagonal_->update({D.data(), static_cast<std::size_t>(D.size())}) == global::SolveStatus::Ok;
  return contact_in_use_;
}

bool Metric::refresh_contact(const model::ContactTerms& contact) {
  normals_in_use_ = false;
  find_contact(contact);
  return factor_with(along_ + across_);
}

bool Metric::refresh_normals(const Positions& x, const model::ContactTerms* contact) {
  if (!normal_) {
    normal_ = std::make_unique<NormalMatrix>(model_, reduction_, reduced_);
    if (global::TreeSolver* tree = solver_->tree())
      normal_solver_.share_analysis(*tree);
    else
      normal_solver_.analyze(global::pattern_of(reduced_));
  }
  normal_->find_normals(x);
  along_.resize(0);
  across_.resize(0);
  if (contact) find_contact(*contact);
  factor_with(across_);
  normals_in_use_ = normal_solver_.factor(normal_->assemble(x, along_)) == global::SolveStatus::Ok;
  return normals_in_use_;
}

void Metric::solve_stretch(const Positions& g, Positions& d) {
  if (global::TreeSolver* tree = stretch_tree()) {
    (void)tree->solve(g.data(), d.data(), 3, 3, 1);
    return;
  }
  if (contact_in_use_ && diagonal_) {
    d.setZero();
    (void)diagonal_->solve(g, d, {contact_solve_.tolerance, contact_solve_.max_iterations, {}});
    return;
  }
  columns_ = g;
  if (solver_->solve(columns_) != global::SolveStatus::Ok)
    throw SimulationError("the global solve failed (out of memory)");
  d = columns_;
}

/// across = S g and along = N^T g: what touches has no say along its normal.
void Metric::split(const Positions& g, Positions& across, Eigen::VectorXd& along) const {
  const auto N = normal_->normals();
  const bool touching = along_.size() > 0;
  if (touching) across.resize(g.rows(), 3);
  along.resize(g.rows());
  parallel_for(static_cast<std::size_t>(g.rows()), [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    along[row] = N.row(row).dot(g.row(row));
    if (touching) across.row(row) = g.row(row) - removed(row, along[row]) * N.row(row);
  });
}

/// d = S d + N along.
void Metric::join(const Eigen::VectorXd& along, Positions& d) const {
  const auto N = normal_->normals();
  const bool touching = along_.size() > 0;
  parallel_for(static_cast<std::size_t>(d.rows()), [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double own = touching ? removed(row, N.row(row).dot(d.row(row))) : 0.0;
    d.row(row) += (along[row] - own) * N.row(row);
  });
}

void Metric::apply(const Positions& g, Positions& d) {
  d.resize(g.rows(), 3);
  if (!normals_in_use_) return solve_stretch(g, d);
  split(g, tangential_, along_normal_);
  const Positions& across = along_.size() > 0 ? tangential_ : g;
  if (global::TreeSolver* tree = stretch_tree()) {
    (void)tree->solve_with(across.data(), d.data(), 3, normal_solver_, along_normal_.data(),
                           along_normal_.data(), 1, 3, 1);
  } else {
    solve_stretch(across, d);
    (void)normal_solver_.solve(along_normal_.data(), along_normal_.data(), 1, 1, 1);
  }
  join(along_normal_, d);
}

}  // namespace piecework::pd
