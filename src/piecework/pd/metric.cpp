#include <piecework/pd/metric.hpp>

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

/// A metric only shapes the path to the minimum: 32 bits do, and their error is not estimated.
global::TreeOptions normal_options(const SparseMatrix& K) {
  if (dynamic_range(K) > kMostOf32Bits) return {};
  return {.precision = global::Precision::Single, .factor_in_single = true, .contraction_limit = 0};
}

}  // namespace

Metric::Metric(const model::ClothModel& model, SparseMatrix K,
               std::unique_ptr<global::ExactSolver> solver)
    : model_(model),
      K_(std::move(K)),
      solver_(std::move(solver)),
      normal_solver_(normal_options(K_)) {}

Metric::~Metric() = default;

void Metric::prepare(const std::vector<char>& fixed) {
  normals_in_use_ = false;
  normal_.reset();
  reduction_ = model::Reduction(model_, fixed);
  reduced_ = reduction_.system(K_);
  const auto status = solver_->factor(reduced_, reduction_.vertices());
  global::require_factor(status, reduction_.count());
}

bool Metric::refresh_normals(const Positions& x) {
  if (!normal_) {
    normal_ = std::make_unique<NormalMatrix>(model_, reduction_, reduced_);
    if (global::TreeSolver* tree = solver_->tree())
      normal_solver_.share_analysis(*tree);
    else
      normal_solver_.analyze(global::pattern_of(reduced_));
  }
  normals_in_use_ = normal_solver_.factor(normal_->assemble(x)) == global::SolveStatus::Ok;
  return normals_in_use_;
}

void Metric::solve_stretch(const Positions& g, Positions& d) {
  if (global::TreeSolver* tree = solver_->tree()) {
    (void)tree->solve(g.data(), d.data(), 3, 3, 1);
    return;
  }
  columns_ = g;
  if (solver_->solve(columns_) != global::SolveStatus::Ok)
    throw SimulationError("the global solve failed (out of memory)");
  d = columns_;
}

void Metric::apply(const Positions& g, Positions& d) {
  d.resize(g.rows(), 3);
  if (!normals_in_use_) return solve_stretch(g, d);
  const auto N = normal_->normals();
  const auto count = static_cast<std::size_t>(g.rows());
  along_normal_.resize(g.rows());
  parallel_for(count, [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    along_normal_[row] = N.row(row).dot(g.row(row));
  });
  if (global::TreeSolver* tree = solver_->tree()) {
    (void)tree->solve_with(g.data(), d.data(), 3, normal_solver_, along_normal_.data(),
                           along_normal_.data(), 1, 3, 1);
  } else {
    solve_stretch(g, d);
    (void)normal_solver_.solve(along_normal_.data(), along_normal_.data(), 1, 1, 1);
  }
  parallel_for(count, [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    d.row(row) += along_normal_[row] * N.row(row);
  });
}

}  // namespace piecework::pd
