#include <piecework/global/cholmod_solver.hpp>

#include <algorithm>
#include <vector>

#include <cholmod.h>
#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>

extern "C" void openblas_set_num_threads(int threads);

namespace piecework::global {
namespace {

SolveStatus to_status(int status) {
  switch (status) {
    case CHOLMOD_OK:
    case CHOLMOD_DSMALL:
      return SolveStatus::Ok;
    case CHOLMOD_OUT_OF_MEMORY:
    case CHOLMOD_TOO_LARGE:
      return SolveStatus::OutOfMemory;
    default:
      return SolveStatus::NotPositiveDefinite;
  }
}

/// A view of K's lower triangle for CHOLMOD; nothing is copied.
cholmod_sparse view(const SparseMatrix& K) {
  cholmod_sparse view{};
  view.nrow = static_cast<std::size_t>(K.rows());
  view.ncol = static_cast<std::size_t>(K.cols());
  view.nzmax = static_cast<std::size_t>(K.nonZeros());
  view.p = const_cast<int*>(K.outerIndexPtr());  // NOLINT: CHOLMOD's C interface is not const
  view.i = const_cast<int*>(K.innerIndexPtr());  // NOLINT
  view.x = const_cast<double*>(K.valuePtr());    // NOLINT
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

/// A view of right-hand sides in column-major order.
cholmod_dense view(double* b, std::size_t rows, std::size_t columns) {
  cholmod_dense view{};
  view.nrow = rows;
  view.ncol = columns;
  view.nzmax = rows * columns;
  view.d = rows;
  view.x = b;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  return view;
}

/// Fill-reducing order of the groups of `block` rows of K, written out for the rows. Empty if METIS
/// runs out of memory.
std::vector<int> order_blocks(const SparseMatrix& K, int block, cholmod_common& common) {
  const auto count = static_cast<int>(K.rows()) / block;
  std::vector<int> begin{0};
  std::vector<int> row;
  for (int group = 0; group < count; ++group) {
    // The first column of a group sees every group at or below it.
    for (SparseMatrix::InnerIterator it(K, group * block); it; ++it) {
      const int other = static_cast<int>(it.row()) / block;
      const bool seen = static_cast<int>(row.size()) > begin.back() && row.back() == other;
      if (other >= group && !seen) row.push_back(other);
    }
    begin.push_back(static_cast<int>(row.size()));
  }
  cholmod_sparse groups{};
  groups.nrow = groups.ncol = static_cast<std::size_t>(count);
  groups.nzmax = row.size();
  groups.p = begin.data();
  groups.i = row.data();
  groups.stype = -1;
  groups.itype = CHOLMOD_INT;
  groups.xtype = CHOLMOD_PATTERN;
  groups.sorted = 1;
  groups.packed = 1;
  std::vector<int> order(static_cast<std::size_t>(count));
  if (!cholmod_metis(&groups, nullptr, 0, 1, order.data(), &common)) return {};
  std::vector<int> rows;
  rows.reserve(static_cast<std::size_t>(K.rows()));
  for (const int group : order)
    for (int i = 0; i < block; ++i) rows.push_back(group * block + i);
  return rows;
}

}  // namespace

struct CholmodSolver::Impl {
  Impl() {
    openblas_set_num_threads(1);
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_METIS;
    common.postorder = 1;
  }
  ~Impl() {
    cholmod_free_factor(&factor, &common);
    cholmod_free_dense(&x, &common);
    cholmod_free_dense(&y, &common);
    cholmod_free_dense(&e, &common);
    cholmod_finish(&common);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  SolveStatus factorize(const SparseMatrix& K) {
    Stopwatch watch;
    cholmod_sparse matrix = view(K);
    const int ok = cholmod_factorize(&matrix, factor, &common);
    SolveStatus status = to_status(common.status);
    if (!ok && status == SolveStatus::Ok) status = SolveStatus::NotPositiveDefinite;
    report.factor_ms = watch.elapsed_ms();
    report.reciprocal_condition = factor ? cholmod_rcond(factor, &common) : 0;
    // BLAS lets NaN pass through a pivot; rcond looks at every one of them.
    if (status == SolveStatus::Ok && !(report.reciprocal_condition > 0))
      status = SolveStatus::NotPositiveDefinite;
    report.nonzeros = common.lnz;
    report.flops = common.fl;
    report.bytes = (factor && factor->is_super) ? factor->xsize * sizeof(double) : 0;
    factored = status == SolveStatus::Ok;
    return status;
  }

  cholmod_common common{};
  cholmod_factor* factor = nullptr;
  cholmod_dense* x = nullptr;  ///< workspaces that cholmod_solve2 keeps from call to call
  cholmod_dense* y = nullptr;
  cholmod_dense* e = nullptr;
  bool factored = false;
  Eigen::Index rows = 0;
  FactorReport report;
};

CholmodSolver::CholmodSolver() : impl_(std::make_unique<Impl>()) {}
CholmodSolver::~CholmodSolver() = default;
CholmodSolver::CholmodSolver(CholmodSolver&&) noexcept = default;
CholmodSolver& CholmodSolver::operator=(CholmodSolver&&) noexcept = default;

SolveStatus CholmodSolver::factor(const SparseMatrix& K) {
  const SolveStatus status = analyze(K, 1);
  if (status != SolveStatus::Ok || K.rows() == 0) return status;
  return impl_->factorize(K);
}

SolveStatus CholmodSolver::analyze(const SparseMatrix& K, int block) {
  cholmod_free_factor(&impl_->factor, &impl_->common);
  impl_->factored = K.rows() == 0;
  impl_->report = {};
  impl_->rows = K.rows();
  if (K.rows() == 0) return SolveStatus::Ok;
  Stopwatch watch;
  cholmod_sparse matrix = view(K);
  if (block == 1) {
    impl_->factor = cholmod_analyze(&matrix, &impl_->common);
  } else {
    std::vector<int> order = order_blocks(K, block, impl_->common);
    if (order.empty()) return SolveStatus::OutOfMemory;
    impl_->common.method[0].ordering = CHOLMOD_GIVEN;
    impl_->factor = cholmod_analyze_p(&matrix, order.data(), nullptr, 0, &impl_->common);
    impl_->common.method[0].ordering = CHOLMOD_METIS;
  }
  impl_->report.analyze_ms = watch.elapsed_ms();
  if (!impl_->factor) return to_status(impl_->common.status);
  impl_->report.nonzeros = impl_->common.lnz;
  impl_->report.bytes = impl_->factor->is_super ? impl_->factor->xsize * sizeof(double) : 0;
  return SolveStatus::Ok;
}

SolveStatus CholmodSolver::refactor(const SparseMatrix& K) {
  if (K.rows() == 0 && impl_->rows == 0) return SolveStatus::Ok;
  if (!impl_->factor) return SolveStatus::NotFactored;
  PIECEWORK_ASSERT(K.rows() == impl_->rows);
  impl_->report.analyze_ms = 0;
  return impl_->factorize(K);
}

SolveStatus CholmodSolver::solve(RightHandSides& b) {
  if (!impl_->factored) return SolveStatus::NotFactored;
  PIECEWORK_ASSERT(b.rows() == impl_->rows);
  return solve(b.data(), 3);
}

SolveStatus CholmodSolver::solve(double* b, int columns) {
  if (!impl_->factored) return SolveStatus::NotFactored;
  const auto rows = static_cast<std::size_t>(impl_->rows);
  const auto count = static_cast<std::size_t>(columns);
  if (rows * count == 0) return SolveStatus::Ok;
  cholmod_dense rhs = view(b, rows, count);
  if (!cholmod_solve2(CHOLMOD_A, impl_->factor, &rhs, nullptr, &impl_->x, nullptr, &impl_->y,
                      &impl_->e, &impl_->common))
    return to_status(impl_->common.status);
  std::copy_n(static_cast<const double*>(impl_->x->x), rows * count, b);
  return SolveStatus::Ok;
}

SolveStatus CholmodSolver::solve_many(Eigen::MatrixXd& b) const {
  if (!impl_->factored) return SolveStatus::NotFactored;
  PIECEWORK_ASSERT(b.rows() == impl_->rows);
  if (b.size() == 0) return SolveStatus::Ok;
  cholmod_dense rhs =
      view(b.data(), static_cast<std::size_t>(b.rows()), static_cast<std::size_t>(b.cols()));
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, impl_->factor, &rhs, &impl_->common);
  if (!x) return to_status(impl_->common.status);
  b = Eigen::Map<const Eigen::MatrixXd>(static_cast<const double*>(x->x), b.rows(), b.cols());
  cholmod_free_dense(&x, &impl_->common);
  return SolveStatus::Ok;
}

double CholmodSolver::smallest_pivot(const SparseMatrix& K) const {
  if (!impl_->factored) return 0;
  if (impl_->rows == 0) return 1;
  const cholmod_factor& L = *impl_->factor;
  const Eigen::VectorXd diagonal = K.diagonal();
  const auto* columns = static_cast<const int*>(L.super);
  const auto* rows = static_cast<const int*>(L.pi);
  const auto* values = static_cast<const int*>(L.px);
  const auto* order = static_cast<const int*>(L.Perm);
  const auto* x = static_cast<const double*>(L.x);
  double smallest = 1;
  for (std::size_t s = 0; s < L.nsuper; ++s) {
    const Eigen::Index height = rows[s + 1] - rows[s];  // a supernode is a dense column-major panel
    for (int column = columns[s]; column < columns[s + 1]; ++column) {
      const double pivot = x[values[s] + (column - columns[s]) * (height + 1)];
      smallest = std::min(smallest, pivot * pivot / diagonal[order[column]]);
    }
  }
  return smallest;
}

const FactorReport& CholmodSolver::report() const { return impl_->report; }

std::string CholmodSolver::description() {
  int version[3];
  cholmod_version(version);
  return fmt::format("CHOLMOD {}.{}.{} supernodal, METIS, OpenBLAS 1 thread", version[0],
                     version[1], version[2]);
}

namespace {

class CholmodExactSolver final : public ExactSolver {
 public:
  SolveStatus factor(const SparseMatrix& K, std::span<const int> /*row_vertex*/) override {
    return solver_.factor(K);
  }
  SolveStatus solve(RightHandSides& b) override { return solver_.solve(b); }
  [[nodiscard]] const FactorReport& report() const override { return solver_.report(); }
  [[nodiscard]] std::string description() const override { return CholmodSolver::description(); }

 private:
  CholmodSolver solver_;
};

}  // namespace

std::unique_ptr<ExactSolver> make_cholmod_solver() {
  return std::make_unique<CholmodExactSolver>();
}

}  // namespace piecework::global
