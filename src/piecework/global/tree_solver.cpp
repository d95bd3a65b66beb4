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

/// What a pattern alone decides; solvers of one pattern share it.
struct Structure {
  Symbolic symbolic;
  FrontEntries entries;
  std::size_t num_values = 0;       ///< entries of the pattern
  std::vector<int> diagonal_entry;  ///< per position: its diagonal entry's index, -1 without
  std::vector<int> front_of;        ///< per row of the matrix
  std::vector<int> column_begin, row_index;  ///< for the estimate in 32 bits; else empty
};

std::shared_ptr<const Structure> build_structure(const SymmetricPattern& pattern, Symbolic symbolic,
                                                 const TreeOptions& options) {
  auto result = std::make_shared<Structure>();
  result->symbolic = std::move(symbolic);
  result->entries = scatter_entries(pattern, result->symbolic);
  const auto rows = static_cast<std::size_t>(pattern.size());
  result->num_values =
      rows > 0 ? static_cast<std::size_t>(pattern.column_begin[rows]) : std::size_t{0};
  result->diagonal_entry.assign(rows, -1);
  for (std::size_t c = 0; c < rows; ++c)
    for (int k = pattern.column_begin[c]; k < pattern.column_begin[c + 1]; ++k)
      if (pattern.row_index[static_cast<std::size_t>(k)] == static_cast<int>(c))
        result->diagonal_entry[static_cast<std::size_t>(result->symbolic.position[c])] = k;
  result->front_of.resize(rows);
  for (std::size_t f = 0; f < result->symbolic.fronts.size(); ++f) {
    const Front& front = result->symbolic.fronts[f];
    for (int c = front.first; c < front.first + front.width; ++c)
      result->front_of[static_cast<std::size_t>(
          result->symbolic.order[static_cast<std::size_t>(c)])] = static_cast<int>(f);
  }
  if (options.precision == Precision::Single && options.contraction_limit > 0) {
    result->column_begin.assign(pattern.column_begin.begin(), pattern.column_begin.end());
    result->row_index.assign(pattern.row_index.begin(), pattern.row_index.end());
  }
  return result;
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
    engine_ = std::make_unique<Engine<T>>(structure->symbolic, isa);
    const TreePlan& plan = engine<T>().plan;
    report.stored_numbers = static_cast<double>(plan.factor_numbers);
    report.bytes = plan.factor_numbers * sizeof(T);
    report.read_bytes = sizeof(T) * (report.stored_numbers + static_cast<double>(plan.own_begin));
    report.fronts = static_cast<int>(plan.fronts.size());
    report.panels = static_cast<int>(plan.panels.size());
    report.subtrees = static_cast<int>(plan.subtrees.size());
    report.levels = static_cast<int>(plan.levels.size());
    report.precision = sizeof(T) == 4 ? Precision::Single : Precision::Double;
    frozen = interior_roots(structure->symbolic, plan, options.frozen_interiors);
  }

  /// Rows of the fronts in scope; a subtree is redone as a whole. Empty: all.
  [[nodiscard]] int rows_in_scope(std::span<const char> changed) const {
    const std::vector<Front>& fronts = structure->symbolic.fronts;
    if (changed.empty()) return structure->symbolic.size();
    int rows = 0;
    with_engine([&](const auto& engine) {
      for (std::size_t f = 0; f < fronts.size(); ++f) {
        const int subtree = engine.plan.fronts[f].subtree;
        const auto root =
            subtree < 0 ? f
                        : static_cast<std::size_t>(
                              engine.plan.subtrees[static_cast<std::size_t>(subtree)].last_front);
        if (changed[root]) rows += fronts[f].width;
      }
    });
    return rows;
  }

  template <class N>
  UpdateMatrices<N>& updates() {
    if constexpr (sizeof(N) == sizeof(float))
      return float_updates;
    else
      return double_updates;
  }

  template <class T, class N>
  SolveStatus factor_with(std::span<const double> values, std::span<const char> changed) {
    const std::vector<int>& entry = structure->diagonal_entry;
    diagonal.resize(entry.size());
    for (std::size_t k = 0; k < entry.size(); ++k)
      diagonal[k] = entry[k] < 0 ? 0.0 : values[static_cast<std::size_t>(entry[k])];
    const NumericInput input{&structure->symbolic,
                             &engine<T>().plan,
                             &structure->entries,
                             values,
                             diagonal,
                             engine<T>().kernel_table.layout,
                             isa,
                             condition_limit()};
    const Scope scope{changed, options.partial_refactor, frozen};
    FactorOutcome outcome = factor_tree<T, N>(input, scope, engine<T>().factor, updates<N>());
    // A singular matrix leaves pivots of rounding error. In 32 bits the contraction tells.
    const double rounding = std::numeric_limits<double>::epsilon() * kPivotRounding *
                            std::sqrt(static_cast<double>(structure->symbolic.size()));
    if (outcome.status == SolveStatus::Ok && outcome.smallest_pivot < rounding)
      outcome.status = SolveStatus::NotPositiveDefinite;
    factored = outcome.status == SolveStatus::Ok;
    report.substituted_panels = engine<T>().factor.num_substituted();
    report.max_condition = outcome.max_condition;
    report.factored_rows = rows_in_scope(changed);
    const double ratio = outcome.min_pivot / outcome.max_pivot;
    report.reciprocal_condition = factored && outcome.max_pivot > 0 ? ratio * ratio : 0;
    return outcome.status;
  }

  /// \param changed  per front; empty: everything
  SolveStatus factor_as_asked(std::span<const double> values, std::span<const char> changed) {
    if (!single()) return factor_with<double, double>(values, changed);
    return options.factor_in_single ? factor_with<float, float>(values, changed)
                                    : factor_with<float, double>(values, changed);
  }

  void check_size(std::span<const double> values) const {
    if (values.size() != structure->num_values)
      throw InputError(fmt::format("matrix values: {} given for a pattern of {} entries",
                                   values.size(), structure->num_values));
  }

  [[nodiscard]] bool can_refactor_parts() const {
    return factored && options.partial_refactor &&
           !(single() && options.factor_in_single ? float_updates.empty() : double_updates.empty());
  }

  template <class Function>
  void with_engine(const Function& function) const {
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

  /// Storage for a factor of `structure`.
  void prepare() {
    factored = false;
    report = {};
    float_updates.clear();
    double_updates.clear();
    if (options.precision == Precision::Single)
      make_engine<float>();
    else
      make_engine<double>();
    report.nonzeros = structure->symbolic.nonzeros;
    report.flops = structure->symbolic.flops;
  }

  double estimate_contraction(std::span<const double> values);
  void multiply(std::span<const double> values, std::span<const double> x,
                std::span<double> y) const;

  TreeOptions options;
  Isa isa;
  std::shared_ptr<const Structure> structure = std::make_shared<Structure>();
  std::vector<double> diagonal;
  UpdateMatrices<float> float_updates;
  UpdateMatrices<double> double_updates;
  std::variant<std::monostate, std::unique_ptr<Engine<float>>, std::unique_ptr<Engine<double>>>
      engine_;
  std::vector<char> frozen;  ///< per front, or empty: roots of interiors
  bool factored = false;
  TreeReport report;
};

/// y = A x for kProbes interleaved columns.
void TreeSolver::Impl::multiply(std::span<const double> values, std::span<const double> x,
                                std::span<double> y) const {
  const std::vector<int>& column_begin = structure->column_begin;
  const std::vector<int>& row_index = structure->row_index;
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
  const auto n = static_cast<std::size_t>(structure->symbolic.size());
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
  Stopwatch watch;
  const graph::Graph graph = pattern.size() > 0
                                 ? graph::graph_of_pattern(pattern.column_begin, pattern.row_index)
                                 : graph::Graph{};
  const std::vector<int> order = dissection_order(graph, domains, impl_->options.seed);
  impl_->structure =
      build_structure(pattern, global::analyze(graph, order, boundary, {}), impl_->options);
  impl_->prepare();
  impl_->report.analyze_ms = watch.elapsed_ms();
}

void TreeSolver::share_analysis(const TreeSolver& other) {
  impl_->structure = other.impl_->structure;
  impl_->prepare();
}

SolveStatus TreeSolver::factor(std::span<const double> values) {
  Impl& impl = *impl_;
  if (impl.engine_.index() == 0) return SolveStatus::NotFactored;
  impl.check_size(values);
  Stopwatch watch;
  try {
    SolveStatus status = impl.factor_as_asked(values, {});
    if (impl.single() && impl.options.contraction_limit > 0) {
      const bool failed = status != SolveStatus::Ok;
      const bool boundary = impl.structure->symbolic.num_boundary > 0;
      impl.report.contraction = failed || boundary ? 0 : impl.estimate_contraction(values);
      if (failed || impl.report.contraction > impl.options.contraction_limit) {
        impl.report.fallback =
            failed ? "the matrix is not positive definite in 32 bits"
                   : fmt::format("a 32-bit solve leaves {:.2g} of the error, more than {:.2g}",
                                 impl.report.contraction, impl.options.contraction_limit);
        impl.make_engine<double>();
        status = impl.factor_with<double, double>(values, {});
      }
    }
    impl.report.factor_ms = watch.elapsed_ms();
    return status;
  } catch (const std::bad_alloc&) {
    impl.factored = false;
    return SolveStatus::OutOfMemory;
  }
}

SolveStatus TreeSolver::refactor_rows(std::span<const double> values, std::span<const int> rows) {
  Impl& impl = *impl_;
  impl.check_size(values);
  if (!impl.can_refactor_parts()) return factor(values);
  const Structure& structure = *impl.structure;
  Stopwatch watch;
  std::vector<char> changed(structure.symbolic.fronts.size(), 0);
  for (const int row : rows) {
    if (row < 0 || row >= structure.symbolic.size())
      throw InputError(fmt::format("rows to refactor: {} is out of range", row));
    changed[static_cast<std::size_t>(structure.front_of[static_cast<std::size_t>(row)])] = 1;
  }
  for (std::size_t f = 0; f < changed.size(); ++f)  // children come before their parents
    if (const int parent = structure.symbolic.fronts[f].parent;
        changed[f] && parent >= 0 && (impl.frozen.empty() || !impl.frozen[f]))
      changed[static_cast<std::size_t>(parent)] = 1;
  try {
    const SolveStatus status = impl.factor_as_asked(values, changed);
    impl.report.factor_ms = watch.elapsed_ms();
    return status;
  } catch (const std::bad_alloc&) {
    impl.factored = false;
    return SolveStatus::OutOfMemory;
  }
}

SolveStatus TreeSolver::solve_with(const double* b, double* x, int columns, TreeSolver& other,
                                   const double* other_b, double* other_x, int other_columns,
                                   std::ptrdiff_t row_stride, std::ptrdiff_t other_row_stride) {
  Impl& ours = *impl_;
  Impl& theirs = *other.impl_;
  if (!ours.factored || !theirs.factored) return SolveStatus::NotFactored;
  const bool together = ours.structure == theirs.structure && ours.single() == theirs.single() &&
                        columns <= kMaxLanes && other_columns <= kMaxLanes;
  if (!together) {
    ours.solve(b, x, columns, row_stride, 1);
    theirs.solve(other_b, other_x, other_columns, other_row_stride, 1);
    return SolveStatus::Ok;
  }
  const auto run = [&](auto& a, auto& c) {
    a.sweep.solve_with(a.factor, {b, row_stride, 1, columns}, {x, row_stride, 1, columns}, c.sweep,
                       c.factor, {other_b, other_row_stride, 1, other_columns},
                       {other_x, other_row_stride, 1, other_columns});
  };
  if (ours.single())
    run(ours.engine<float>(), theirs.engine<float>());
  else
    run(ours.engine<double>(), theirs.engine<double>());
  return SolveStatus::Ok;
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

TreeSchedule TreeSolver::profile(const double* b, double* x) {
  PIECEWORK_ASSERT(impl_->factored);
  TreeSchedule schedule;
  impl_->with_engine([&](auto& engine) {
    engine.sweep.profile(engine.factor, {b, 3, 1, 3}, {x, 3, 1, 3}, schedule);
  });
  return schedule;
}

int TreeSolver::size() const { return impl_->structure->symbolic.size(); }

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
