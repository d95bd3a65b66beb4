#include <piecework/global/tree_solver.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <new>
#include <variant>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/random.hpp>
#include <piecework/global/symbolic.hpp>

#include "tree_sweep.hpp"

namespace piecework::global {
namespace {

void check_pattern(const SymmetricPattern& pattern) {
  const int n = pattern.size();
  if (n == 0) return;
  if (pattern.column_begin[0] != 0 || pattern.column_begin[static_cast<std::size_t>(n)] >
                                          static_cast<int>(pattern.row_index.size()))
    throw InputError("matrix pattern: column_begin does not fit row_index");
  for (int c = 0; c < n; ++c) {
    const int begin = pattern.column_begin[static_cast<std::size_t>(c)];
    const int end = pattern.column_begin[static_cast<std::size_t>(c) + 1];
    if (end < begin)
      throw InputError(fmt::format("matrix pattern: column {} ends before it begins", c));
    for (int k = begin; k < end; ++k)
      if (const int row = pattern.row_index[static_cast<std::size_t>(k)]; row < 0 || row >= n)
        throw InputError(
            fmt::format("matrix pattern: column {} has row {}; there are {} rows", c, row, n));
  }
}

void check_domains(const DomainTree& domains, int rows) {
  const auto nodes = static_cast<int>(domains.node_parent.size());
  if (static_cast<int>(domains.row_node.size()) != rows)
    throw InputError(fmt::format("domain tree: {} rows have a node, the matrix has {}",
                                 domains.row_node.size(), rows));
  for (int node = 0; node < nodes; ++node)
    if (const int parent = domains.node_parent[static_cast<std::size_t>(node)];
        parent < -1 || parent >= node)
      throw InputError(
          fmt::format("domain tree: node {} has parent {}; parents come first", node, parent));
  for (const int node : domains.row_node)
    if (node < 0 || node >= nodes)
      throw InputError(fmt::format("domain tree: a row has node {} of {}", node, nodes));
}

void check_boundary(std::span<const int> boundary, int rows) {
  std::vector<char> seen(static_cast<std::size_t>(rows), 0);
  for (const int row : boundary) {
    if (row < 0 || row >= rows || seen[static_cast<std::size_t>(row)])
      throw InputError(fmt::format("boundary: row {} is out of range or named twice", row));
    seen[static_cast<std::size_t>(row)] = 1;
  }
}

/// Pivots below so many roundings (times the root of the number of rows) of their diagonal entry
/// are those of a singular matrix. Chosen.
constexpr double kPivotRounding = 10;

/// Random errors by which the contraction of a 32-bit solve is estimated.
constexpr int kProbes = 3;

/// Everything that depends on the storage type.
template <class T>
struct Engine {
  Engine(const Symbolic& symbolic, Isa isa)
      : kernel_table(kernels<T>(isa)),
        plan(plan_tree(symbolic, {}, kernel_table.layout)),
        sweep(symbolic, plan, kernel_table) {}
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  const Kernels<T>& kernel_table;
  TreePlan plan;
  TreeFactor<T> factor;
  TreeSweep<T> sweep;
};

/// Sum of all stored numbers, by blocks in parallel.
template <class T>
double sum_of(const AlignedArray<T>& numbers) {
  constexpr std::size_t kBlock = 1U << 15;
  const T* data = numbers.data();
  const std::size_t blocks = (numbers.size() + kBlock - 1) / kBlock;
  return parallel_sum<double>(
      blocks,
      [&](std::size_t block) {
        const std::size_t end = std::min(numbers.size(), (block + 1) * kBlock);
        T sums[64] = {};
        std::size_t i = block * kBlock;
        for (; i + 64 <= end; i += 64)
          for (std::size_t k = 0; k < 64; ++k) sums[k] += data[i + k];
        double total = 0;
        for (const T sum : sums) total += static_cast<double>(sum);
        return total;
      },
      1);
}

}  // namespace

struct TreeSolver::Impl {
  explicit Impl(const TreeOptions& o) : options(o), isa(o.isa.value_or(best_isa())) {}

  [[nodiscard]] double condition_limit() const {
    return options.condition_limit.value_or(report.precision == Precision::Double ? 1e4 : 1e3);
  }

  template <class T>
  Engine<T>& engine() {
    return *std::get<std::unique_ptr<Engine<T>>>(engine_);
  }
  [[nodiscard]] bool single() const { return engine_.index() == 1; }

  template <class T>
  void make_engine() {
    engine_ = std::make_unique<Engine<T>>(symbolic, isa);
    const TreePlan& plan = engine<T>().plan;
    report.stored_numbers = static_cast<double>(plan.factor_numbers);
    report.bytes = plan.factor_numbers * sizeof(T);
    report.read_bytes = sizeof(T) * (report.stored_numbers + static_cast<double>(plan.own_begin));
    report.fronts = static_cast<int>(plan.fronts.size());
    report.panels = static_cast<int>(plan.panels.size());
    report.subtrees = static_cast<int>(plan.subtrees.size());
    report.levels = static_cast<int>(plan.levels.size());
    report.precision = sizeof(T) == 4 ? Precision::Single : Precision::Double;
  }

  template <class T, class N>
  SolveStatus factor_with(std::span<const double> values) {
    for (std::size_t k = 0; k < diagonal_entry.size(); ++k)
      diagonal[k] =
          diagonal_entry[k] < 0 ? 0.0 : values[static_cast<std::size_t>(diagonal_entry[k])];
    const NumericInput input{&symbolic, &engine<T>().plan, &entries,
                             values,    diagonal,          engine<T>().kernel_table.layout,
                             isa,       condition_limit()};
    FactorOutcome outcome = factor_tree<T, N>(input, engine<T>().factor);
    // A singular matrix leaves pivots of rounding error. In 32 bits the contraction tells.
    const double rounding = std::numeric_limits<double>::epsilon() * kPivotRounding *
                            std::sqrt(static_cast<double>(symbolic.size()));
    if (outcome.status == SolveStatus::Ok && outcome.smallest_pivot < rounding)
      outcome.status = SolveStatus::NotPositiveDefinite;
    factored = outcome.status == SolveStatus::Ok;
    report.substituted_panels = outcome.substituted_panels;
    report.max_condition = outcome.max_condition;
    const double ratio = outcome.min_pivot / outcome.max_pivot;
    report.reciprocal_condition = factored && symbolic.size() > 0 ? ratio * ratio : 0;
    return outcome.status;
  }

  SolveStatus factor_as_asked(std::span<const double> values) {
    if (!single()) return factor_with<double, double>(values);
    return options.factor_in_single ? factor_with<float, float>(values)
                                    : factor_with<float, double>(values);
  }

  template <class Function>
  void with_engine(const Function& function) {
    std::visit(
        [&](auto& engine) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(engine)>, std::monostate>)
            function(*engine);
        },
        engine_);
  }

  void solve(const double* b, double* x, int columns, std::ptrdiff_t rows, std::ptrdiff_t cols) {
    for (int first = 0; first < columns; first += kMaxLanes) {
      const int count = std::min(kMaxLanes, columns - first);
      with_engine([&](auto& engine) {
        engine.sweep.solve(engine.factor, {b + first * cols, rows, cols, count},
                           {x + first * cols, rows, cols, count});
      });
    }
  }

  double estimate_contraction(std::span<const double> values);
  void multiply(std::span<const double> values, std::span<const double> x,
                std::span<double> y) const;

  TreeOptions options;
  Isa isa;
  Symbolic symbolic;
  FrontEntries entries;
  std::size_t num_values = 0;       ///< entries of the pattern
  std::vector<int> diagonal_entry;  ///< per position: its diagonal entry's index, -1 without
  std::vector<double> diagonal;
  std::vector<int> column_begin, row_index;  ///< of the pattern, for the estimate in 32 bits
  std::variant<std::monostate, std::unique_ptr<Engine<float>>, std::unique_ptr<Engine<double>>>
      engine_;
  bool factored = false;
  TreeReport report;
};

/// y = A x for kProbes interleaved columns.
void TreeSolver::Impl::multiply(std::span<const double> values, std::span<const double> x,
                                std::span<double> y) const {
  std::fill(y.begin(), y.end(), 0.0);
  for (std::size_t c = 0; c + 1 < column_begin.size(); ++c)
    for (int k = column_begin[c]; k < column_begin[c + 1]; ++k) {
      const auto r = static_cast<std::size_t>(row_index[static_cast<std::size_t>(k)]);
      if (r < c) continue;
      const double value = values[static_cast<std::size_t>(k)];
      for (std::size_t l = 0; l < kProbes; ++l) {
        y[kProbes * r + l] += value * x[kProbes * c + l];
        if (r != c) y[kProbes * c + l] += value * x[kProbes * r + l];
      }
    }
}

/// Largest energy norm that is left of random errors after one more solve, in the second of
/// two steps e <- e - M^-1 A e (the first one turns them towards the worst direction).
double TreeSolver::Impl::estimate_contraction(std::span<const double> values) {
  const auto n = static_cast<std::size_t>(symbolic.size());
  std::vector<double> error(kProbes * n);
  std::vector<double> image(kProbes * n);
  std::vector<double> change(kProbes * n);
  Random random(1);
  for (double& e : error) e = random.uniform(-1, 1);
  const auto energies = [&] {
    multiply(values, error, image);
    std::array<double, kProbes> sum{};
    for (std::size_t i = 0; i < kProbes * n; ++i) sum[i % kProbes] += error[i] * image[i];
    return sum;
  };
  double worst = 0;
  std::array<double, kProbes> before = energies();
  for (int step = 0; step < 2; ++step) {
    solve(image.data(), change.data(), kProbes, kProbes, 1);
    for (std::size_t i = 0; i < kProbes * n; ++i) error[i] -= change[i];
    const std::array<double, kProbes> after = energies();
    worst = 0;
    for (std::size_t l = 0; l < kProbes; ++l) {
      const double ratio = std::sqrt(after[l] / before[l]);
      worst = before[l] > 0 ? std::max(worst, std::isfinite(ratio) ? ratio : 1e300) : worst;
    }
    before = after;
  }
  return worst;
}

TreeSolver::TreeSolver(const TreeOptions& options) : impl_(std::make_unique<Impl>(options)) {}
TreeSolver::~TreeSolver() = default;
TreeSolver::TreeSolver(TreeSolver&&) noexcept = default;
TreeSolver& TreeSolver::operator=(TreeSolver&&) noexcept = default;

void TreeSolver::analyze(const SymmetricPattern& pattern, const DomainTree* domains,
                         std::span<const int> boundary) {
  check_pattern(pattern);
  if (domains) check_domains(*domains, pattern.size());
  check_boundary(boundary, pattern.size());
  Impl& impl = *impl_;
  impl.num_values = pattern.size() > 0 ? static_cast<std::size_t>(pattern.column_begin.back()) : 0;
  impl.factored = false;
  impl.report = {};
  Stopwatch watch;
  const graph::Graph graph = pattern.size() > 0
                                 ? graph::graph_of_pattern(pattern.column_begin, pattern.row_index)
                                 : graph::Graph{};
  const std::vector<int> order = dissection_order(graph, domains, impl.options.seed);
  impl.symbolic = global::analyze(graph, order, boundary, {});
  impl.entries = scatter_entries(pattern, impl.symbolic);
  impl.diagonal_entry.assign(static_cast<std::size_t>(pattern.size()), -1);
  impl.diagonal.resize(impl.diagonal_entry.size());
  for (int c = 0; c < pattern.size(); ++c)
    for (int k = pattern.column_begin[static_cast<std::size_t>(c)];
         k < pattern.column_begin[static_cast<std::size_t>(c) + 1]; ++k)
      if (pattern.row_index[static_cast<std::size_t>(k)] == c)
        impl.diagonal_entry[static_cast<std::size_t>(
            impl.symbolic.position[static_cast<std::size_t>(c)])] = k;
  impl.column_begin.clear();
  impl.row_index.clear();
  if (impl.options.precision == Precision::Single && impl.options.contraction_limit > 0) {
    impl.column_begin.assign(pattern.column_begin.begin(), pattern.column_begin.end());
    impl.row_index.assign(pattern.row_index.begin(), pattern.row_index.end());
  }
  if (impl.options.precision == Precision::Single)
    impl.make_engine<float>();
  else
    impl.make_engine<double>();
  impl.report.nonzeros = impl.symbolic.nonzeros;
  impl.report.flops = impl.symbolic.flops;
  impl.report.analyze_ms = watch.elapsed_ms();
}

SolveStatus TreeSolver::factor(std::span<const double> values) {
  Impl& impl = *impl_;
  if (impl.engine_.index() == 0) return SolveStatus::NotFactored;
  if (values.size() != impl.num_values)
    throw InputError(fmt::format("matrix values: {} given for a pattern of {} entries",
                                 values.size(), impl.num_values));
  Stopwatch watch;
  try {
    SolveStatus status = impl.factor_as_asked(values);
    if (impl.single() && impl.options.contraction_limit > 0) {
      const bool failed = status != SolveStatus::Ok;
      impl.report.contraction =
          failed || impl.symbolic.num_boundary > 0 ? 0 : impl.estimate_contraction(values);
      if (failed || impl.report.contraction > impl.options.contraction_limit) {
        impl.report.fallback =
            failed ? "the matrix is not positive definite in 32 bits"
                   : fmt::format("a 32-bit solve leaves {:.2g} of the error, more than {:.2g}",
                                 impl.report.contraction, impl.options.contraction_limit);
        impl.make_engine<double>();
        status = impl.factor_with<double, double>(values);
      }
    }
    impl.report.factor_ms = watch.elapsed_ms();
    return status;
  } catch (const std::bad_alloc&) {
    impl.factored = false;
    return SolveStatus::OutOfMemory;
  }
}

SolveStatus TreeSolver::solve(const double* b, double* x, int columns, std::ptrdiff_t row_stride,
                              std::ptrdiff_t column_stride) {
  if (!impl_->factored) return SolveStatus::NotFactored;
  impl_->solve(b, x, columns, row_stride, column_stride);
  return SolveStatus::Ok;
}

std::span<const double> TreeSolver::schur() const {
  std::span<const double> result;
  impl_->with_engine([&](auto& engine) { result = engine.factor.schur; });
  return result;
}

SolveStatus TreeSolver::condense(const double* b, int columns, std::ptrdiff_t row_stride,
                                 std::ptrdiff_t column_stride, double* boundary) {
  if (!impl_->factored) return SolveStatus::NotFactored;
  impl_->with_engine([&](auto& engine) {
    engine.sweep.condense(engine.factor, {b, row_stride, column_stride, columns}, boundary);
  });
  return SolveStatus::Ok;
}

SolveStatus TreeSolver::expand(const double* boundary, double* x, int columns,
                               std::ptrdiff_t row_stride, std::ptrdiff_t column_stride) {
  if (!impl_->factored) return SolveStatus::NotFactored;
  impl_->with_engine([&](auto& engine) {
    engine.sweep.expand(engine.factor, boundary, {x, row_stride, column_stride, columns});
  });
  return SolveStatus::Ok;
}

int TreeSolver::size() const { return impl_->symbolic.size(); }

const TreeReport& TreeSolver::report() const { return impl_->report; }

double TreeSolver::read_factor() const {
  double sum = 0;
  impl_->with_engine([&](auto& engine) { sum = sum_of(engine.factor.numbers); });
  return sum;
}

std::string TreeSolver::description() const {
  const Precision precision =
      impl_->engine_.index() == 0 ? impl_->options.precision : impl_->report.precision;
  return fmt::format("tree, {}-bit factor, {}, {}", precision == Precision::Single ? 32 : 64,
                     to_string(impl_->isa), graph::metis_version());
}

}  // namespace piecework::global
