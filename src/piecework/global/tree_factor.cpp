#include "tree_factor.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

#include "dense.hpp"

namespace piecework::global {

FrontEntries scatter_entries(const SymmetricPattern& pattern, const Symbolic& symbolic) {
  const auto n = static_cast<std::size_t>(symbolic.size());
  std::vector<int> front_of(n);
  for (std::size_t f = 0; f < symbolic.fronts.size(); ++f)
    for (int c = 0; c < symbolic.fronts[f].width; ++c)
      front_of[static_cast<std::size_t>(symbolic.fronts[f].first + c)] = static_cast<int>(f);

  // Entry k sits in column min(position) of L, row max(position).
  struct Place {
    int low, high;
  };
  const auto place = [&](int row, int column) {
    const auto [low, high] = std::minmax(symbolic.position[static_cast<std::size_t>(row)],
                                         symbolic.position[static_cast<std::size_t>(column)]);
    return Place{low, high};
  };
  FrontEntries result;
  result.begin.assign(symbolic.fronts.size() + 1, 0);
  const auto for_each_entry = [&](const auto& visit) {
    for (int column = 0; column < pattern.size(); ++column)
      for (int k = pattern.column_begin[static_cast<std::size_t>(column)];
           k < pattern.column_begin[static_cast<std::size_t>(column) + 1]; ++k)
        if (const int row = pattern.row_index[static_cast<std::size_t>(k)]; row >= column)
          visit(k, place(row, column));
  };
  for_each_entry([&](int, Place p) {
    ++result.begin[static_cast<std::size_t>(front_of[static_cast<std::size_t>(p.low)]) + 1];
  });
  for (std::size_t f = 0; f < symbolic.fronts.size(); ++f) result.begin[f + 1] += result.begin[f];
  result.entries.resize(result.begin.back());
  std::vector<int> row_of(result.entries.size());
  std::vector<std::size_t> cursor(result.begin.begin(), result.begin.end() - 1);
  for_each_entry([&](int k, Place p) {
    const int f = front_of[static_cast<std::size_t>(p.low)];
    const std::size_t slot = cursor[static_cast<std::size_t>(f)]++;
    result.entries[slot] = {k, static_cast<unsigned>(p.low)};
    row_of[slot] = p.high;
  });
  parallel_for(
      symbolic.fronts.size(),
      [&](std::size_t f) {
        const Front& front = symbolic.fronts[f];
        const auto rows = symbolic.front_rows(front);
        const auto size = static_cast<unsigned>(front.width + front.num_rows);
        for (std::size_t e = result.begin[f]; e < result.begin[f + 1]; ++e) {
          const int row = row_of[e];
          const auto local = static_cast<unsigned>(
              row < front.first + front.width
                  ? row - front.first
                  : front.width + (std::lower_bound(rows.begin(), rows.end(), row) - rows.begin()));
          const unsigned column = result.entries[e].offset - static_cast<unsigned>(front.first);
          result.entries[e].offset = local + column * size;
        }
      },
      16);
  return result;
}

namespace {

/// Side of the tiles into which the work on large fronts is divided.
constexpr int kTile = 192;

/// Fronts below this many rows are worked on by one thread.
constexpr int kTiledFront = 2 * kTile;

/// A front's matrix: (width + rows)^2, column-major, lower triangle.
template <class N>
struct FrontMatrix {
  N* data;
  int width;
  int rows;
  [[nodiscard]] int size() const { return width + rows; }
  [[nodiscard]] N* at(int row, int column) const {
    return data + static_cast<std::size_t>(column) * static_cast<std::size_t>(size()) + row;
  }
};

template <class T, class N>
class Factorizer {
 public:
  Factorizer(const NumericInput& input, TreeFactor<T>& factor)
      : input_(input), symbolic_(*input.symbolic), plan_(*input.plan), factor_(factor) {}

  FactorOutcome run();

 private:
  struct Scratch {
    AlignedArray<N> front, panel;
    std::vector<int> relative;
    AlignedArray<N> stack;
    FactorOutcome outcome;
    N* front_of(std::size_t count) { return grow(front, count); }
    N* panel_of(std::size_t count) { return grow(panel, count); }
    static N* grow(AlignedArray<N>& array, std::size_t count) {
      if (array.size() < count) array = AlignedArray<N>(count);
      return array.data();
    }
  };

  [[nodiscard]] const Front& front(int f) const {
    return symbolic_.fronts[static_cast<std::size_t>(f)];
  }
  void factor_subtree(const Subtree& subtree, Scratch& scratch);
  void factor_top(int f, Scratch& scratch);
  void assemble(int f, const FrontMatrix<N>& matrix);
  void extend_add(int child, const N* update, int parent, const FrontMatrix<N>& matrix,
                  std::vector<int>& relative);
  bool eliminate(int f, const FrontMatrix<N>& matrix, bool tiled, Scratch& scratch);
  void update_trailing(const FrontMatrix<N>& matrix, int first, int end, bool tiled);
  void store_panel(std::size_t p, const FrontMatrix<N>& matrix, double norm, Scratch& scratch);
  void pack(const N* from, int ld, int rows, int cols, N sign, T* to) const;
  static double norm1(int n, const N* a, int lda);
  void note(const FactorOutcome& part, FactorOutcome& whole) const;

  const NumericInput& input_;
  const Symbolic& symbolic_;
  const TreePlan& plan_;
  TreeFactor<T>& factor_;
  std::vector<AlignedArray<N>> updates_;  ///< of roots of subtrees and of fronts above them
};

/// 1-norm of a symmetric matrix given by its lower triangle.
template <class T, class N>
double Factorizer<T, N>::norm1(int n, const N* a, int lda) {
  std::vector<double> sum(static_cast<std::size_t>(n), 0.0);
  for (int c = 0; c < n; ++c) {
    const N* column = a + static_cast<std::size_t>(c) * static_cast<std::size_t>(lda);
    double below = std::abs(static_cast<double>(column[c]));
    for (int r = c + 1; r < n; ++r) {
      const double value = std::abs(static_cast<double>(column[r]));
      below += value;
      sum[static_cast<std::size_t>(r)] += value;
    }
    sum[static_cast<std::size_t>(c)] += below;
  }
  return n > 0 ? *std::max_element(sum.begin(), sum.end()) : 0.0;
}

template <class T, class N>
void Factorizer<T, N>::assemble(int f, const FrontMatrix<N>& matrix) {
  const auto size = static_cast<std::size_t>(matrix.size());
  std::memset(matrix.data, 0, size * size * sizeof(N));
  const FrontEntries& entries = *input_.entries;
  for (std::size_t e = entries.begin[static_cast<std::size_t>(f)];
       e < entries.begin[static_cast<std::size_t>(f) + 1]; ++e)
    matrix.data[entries.entries[e].offset] +=
        static_cast<N>(input_.values[static_cast<std::size_t>(entries.entries[e].value)]);
}

/// Adds a child's update matrix, by runs of rows that stay together.
template <class T, class N>
void Factorizer<T, N>::extend_add(int child, const N* update, int parent,
                                  const FrontMatrix<N>& matrix, std::vector<int>& relative) {
  const auto rows = symbolic_.front_rows(front(child));
  const auto parent_rows = symbolic_.front_rows(front(parent));
  const int first = front(parent).first;
  relative.resize(rows.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i] < first + matrix.width) {
      relative[i] = rows[i] - first;
    } else {
      while (parent_rows[k] != rows[i]) ++k;
      relative[i] = matrix.width + static_cast<int>(k);
    }
  }
  const std::size_t count = rows.size();
  for (std::size_t c = 0; c < count; ++c) {
    const N* from = update + c * count;
    N* to = matrix.at(0, relative[c]);
    for (std::size_t r = c; r < count;) {
      std::size_t end = r + 1;
      while (end < count && relative[end] == relative[end - 1] + 1) ++end;
      N* target = to + relative[r];
      for (std::size_t i = r; i < end; ++i) target[i - r] += from[i];
      r = end;
    }
  }
}

/// Lower triangle of everything from row and column `end` on -= L L^T with L's columns
/// first ... end - 1.
template <class T, class N>
void Factorizer<T, N>::update_trailing(const FrontMatrix<N>& matrix, int first, int end,
                                       bool tiled) {
  const int rest = matrix.size() - end;
  const int depth = end - first;
  if (rest == 0) return;
  if (!tiled) {
    dense::subtract_square<N>(rest, depth, matrix.at(end, first), matrix.size(),
                              matrix.at(end, end), matrix.size());
    return;
  }
  const int blocks = (rest + kTile - 1) / kTile;
  const auto count = static_cast<std::size_t>(blocks) * static_cast<std::size_t>(blocks + 1) / 2;
  parallel_for(
      count,
      [&](std::size_t tile) {
        int column = 0;  // tiles of the lower triangle, column after column
        auto row = static_cast<int>(tile);
        while (row >= blocks - column) row -= blocks - column++;
        row += column;
        const int r = end + row * kTile;
        const int c = end + column * kTile;
        const int rows = std::min(kTile, matrix.size() - r);
        const int cols = std::min(kTile, matrix.size() - c);
        if (row == column)
          dense::subtract_square<N>(rows, depth, matrix.at(r, first), matrix.size(),
                                    matrix.at(r, c), matrix.size());
        else
          dense::subtract_product<N>(rows, cols, depth, matrix.at(r, first), matrix.size(),
                                     matrix.at(c, first), matrix.size(), matrix.at(r, c),
                                     matrix.size());
      },
      1);
}

/// A block of a panel, in the order in which the sweeps read it.
template <class T, class N>
void Factorizer<T, N>::pack(const N* from, int ld, int rows, int cols, N sign, T* to) const {
  const PanelLayout& layout = input_.layout;
  for (int first = 0; first < cols; first += layout.strip_cols) {
    const int count = std::min(layout.strip_cols, cols - first);
    T* out = to;
    for (int r = 0; r < rows; r += layout.chunk_rows) {
      const int chunk = std::min(layout.chunk_rows, rows - r);
      for (int c = first; c < first + count; ++c) {
        const N* column = from + static_cast<std::size_t>(c) * static_cast<std::size_t>(ld) + r;
        for (int i = 0; i < chunk; ++i) out[i] = static_cast<T>(sign * column[i]);
        out += chunk;
      }
    }
    to += layout.aligned(static_cast<std::size_t>(rows) * static_cast<std::size_t>(count));
  }
}

/// Writes panel p, whose columns of L are done, in the form that the sweeps read.
template <class T, class N>
void Factorizer<T, N>::store_panel(std::size_t p, const FrontMatrix<N>& matrix, double norm,
                                   Scratch& scratch) {
  const Panel& panel = plan_.panels[p];
  const int cols = panel.cols;
  const N* l_own = matrix.at(panel.first, panel.first);
  const N* l_below = matrix.at(panel.first + cols, panel.first);
  T* own = factor_.numbers.data() + panel.own;
  T* below = factor_.numbers.data() + panel.below;
  const auto size = static_cast<std::size_t>(cols);
  N* inverse = scratch.panel_of(size * (size + static_cast<std::size_t>(panel.rows)));
  for (std::size_t c = 0; c < size; ++c)
    std::copy_n(l_own + c * static_cast<std::size_t>(matrix.size()), cols, inverse + c * size);
  dense::invert_from_cholesky<N>(cols, inverse, cols);
  const double condition = norm * norm1(cols, inverse, cols);
  const bool substitute = !(condition <= input_.condition_limit);
  factor_.substituted[p] = substitute;
  if (substitute) {
    ++scratch.outcome.substituted_panels;
    pack(l_own, matrix.size(), cols, cols, N(1), own);
    pack(l_below, matrix.size(), panel.rows, cols, N(-1), below);
    return;
  }
  scratch.outcome.max_condition = std::max(scratch.outcome.max_condition, condition);
  for (std::size_t c = 0; c < size; ++c)
    for (std::size_t r = 0; r < c; ++r) inverse[c * size + r] = inverse[r * size + c];
  pack(inverse, cols, cols, cols, N(1), own);
  if (panel.rows == 0) return;
  N* b = inverse + size * size;
  const auto rows = static_cast<std::size_t>(panel.rows);
  for (std::size_t c = 0; c < size; ++c)
    std::copy_n(l_below + c * static_cast<std::size_t>(matrix.size()), rows, b + c * rows);
  dense::solve_right<N>(panel.rows, cols, l_own, matrix.size(), b, panel.rows);
  pack(b, panel.rows, panel.rows, cols, N(-1), below);
}

/// Factors the front's own columns, panel by panel; its update matrix is left below them.
template <class T, class N>
bool Factorizer<T, N>::eliminate(int f, const FrontMatrix<N>& matrix, bool tiled,
                                 Scratch& scratch) {
  const FrontPlan& plan = plan_.fronts[static_cast<std::size_t>(f)];
  for (int k = 0; k < plan.num_panels; ++k) {
    const std::size_t p = plan.first_panel + static_cast<std::size_t>(k);
    const Panel& panel = plan_.panels[p];
    const int end = panel.first + panel.cols;
    const int below = matrix.size() - end;
    N* pivot = matrix.at(panel.first, panel.first);
    const double norm = norm1(panel.cols, pivot, matrix.size());
    if (!dense::cholesky<N>(panel.cols, pivot, matrix.size())) return false;
    for (int c = 0; c < panel.cols; ++c) {
      const auto diagonal = static_cast<double>(*matrix.at(panel.first + c, panel.first + c));
      if (!(diagonal > 0) || !std::isfinite(diagonal)) return false;  // BLAS lets NaN through
      scratch.outcome.min_pivot = std::min(scratch.outcome.min_pivot, diagonal);
      scratch.outcome.max_pivot = std::max(scratch.outcome.max_pivot, diagonal);
    }
    if (below > 0) {
      if (tiled) {
        parallel_for(
            static_cast<std::size_t>((below + kTile - 1) / kTile),
            [&](std::size_t tile) {
              const int r = end + static_cast<int>(tile) * kTile;
              dense::solve_right_transposed<N>(std::min(kTile, matrix.size() - r), panel.cols,
                                               pivot, matrix.size(), matrix.at(r, panel.first),
                                               matrix.size());
            },
            1);
      } else {
        dense::solve_right_transposed<N>(below, panel.cols, pivot, matrix.size(),
                                         matrix.at(end, panel.first), matrix.size());
      }
    }
    update_trailing(matrix, panel.first, end, tiled);
    store_panel(p, matrix, norm, scratch);
  }
  return true;
}

/// Postorder with a stack of update matrices; the root's is left in updates_.
template <class T, class N>
void Factorizer<T, N>::factor_subtree(const Subtree& subtree, Scratch& scratch) {
  const auto square = [&](int f) {
    return static_cast<std::size_t>(front(f).num_rows) *
           static_cast<std::size_t>(front(f).num_rows);
  };
  std::size_t used = 0;
  std::size_t peak = 0;
  for (int f = subtree.first_front; f <= subtree.last_front; ++f) {
    for (const int child : plan_.children[static_cast<std::size_t>(f)]) used -= square(child);
    used += square(f);
    peak = std::max(peak, used);
  }
  N* stack = Scratch::grow(scratch.stack, peak);
  N* top = stack;
  for (int f = subtree.first_front; f <= subtree.last_front; ++f) {
    const Front& current = front(f);
    const auto size = static_cast<std::size_t>(current.width + current.num_rows);
    const FrontMatrix<N> matrix{scratch.front_of(size * size), current.width, current.num_rows};
    assemble(f, matrix);
    // Children lie on the stack in order; the first one deepest.
    const auto& children = plan_.children[static_cast<std::size_t>(f)];
    for (const int child : children) top -= square(child);
    const N* update = top;
    for (const int child : children) {
      extend_add(child, update, f, matrix, scratch.relative);
      update += square(child);
    }
    if (!eliminate(f, matrix, false, scratch)) {
      scratch.outcome.status = SolveStatus::NotPositiveDefinite;
      return;
    }
    const auto rows = static_cast<std::size_t>(current.num_rows);
    N* out = top;
    if (f == subtree.last_front) {
      updates_[static_cast<std::size_t>(f)] = AlignedArray<N>(rows * rows);
      out = updates_[static_cast<std::size_t>(f)].data();
    } else {
      top += square(f);
    }
    for (std::size_t c = 0; c < rows; ++c)
      std::copy_n(
          matrix.at(current.width + static_cast<int>(c), current.width + static_cast<int>(c)),
          rows - c, out + c * rows + c);
  }
}

template <class T, class N>
void Factorizer<T, N>::factor_top(int f, Scratch& scratch) {
  const Front& current = front(f);
  const auto size = static_cast<std::size_t>(current.width + current.num_rows);
  const FrontMatrix<N> matrix{scratch.front_of(size * size), current.width, current.num_rows};
  assemble(f, matrix);
  for (const int child : plan_.children[static_cast<std::size_t>(f)]) {
    extend_add(child, updates_[static_cast<std::size_t>(child)].data(), f, matrix,
               scratch.relative);
    updates_[static_cast<std::size_t>(child)] = {};
  }
  if (f == plan_.boundary_front) {
    factor_.schur.assign(matrix.data, matrix.data + size * size);
    return;
  }
  if (!eliminate(f, matrix, matrix.size() >= kTiledFront, scratch)) {
    scratch.outcome.status = SolveStatus::NotPositiveDefinite;
    return;
  }
  const auto rows = static_cast<std::size_t>(current.num_rows);
  auto& update = updates_[static_cast<std::size_t>(f)];
  update = AlignedArray<N>(rows * rows);
  for (std::size_t c = 0; c < rows; ++c)
    std::copy_n(matrix.at(current.width + static_cast<int>(c), current.width + static_cast<int>(c)),
                rows - c, update.data() + c * rows + c);
}

template <class T, class N>
void Factorizer<T, N>::note(const FactorOutcome& part, FactorOutcome& whole) const {
  if (part.status != SolveStatus::Ok) whole.status = part.status;
  whole.min_pivot = std::min(whole.min_pivot, part.min_pivot);
  whole.max_pivot = std::max(whole.max_pivot, part.max_pivot);
  whole.max_condition = std::max(whole.max_condition, part.max_condition);
  whole.substituted_panels += part.substituted_panels;
}

template <class T, class N>
FactorOutcome Factorizer<T, N>::run() {
  dense::use_one_thread();
  if (factor_.numbers.size() != plan_.factor_numbers)
    factor_.numbers = AlignedArray<T>(plan_.factor_numbers);
  factor_.substituted.assign(plan_.panels.size(), 0);
  factor_.schur.clear();
  updates_.resize(symbolic_.fronts.size());
  FactorOutcome start;
  start.min_pivot = std::numeric_limits<double>::infinity();
  FactorOutcome whole = start;

  std::vector<FactorOutcome> outcomes(plan_.tasks.size(), start);
  parallel_for(
      plan_.tasks.size(),
      [&](std::size_t t) {
        Scratch scratch;
        scratch.outcome = start;
        for (const int s : plan_.tasks[t]) {
          factor_subtree(plan_.subtrees[static_cast<std::size_t>(s)], scratch);
          if (scratch.outcome.status != SolveStatus::Ok) break;
        }
        outcomes[t] = scratch.outcome;
      },
      1);
  for (const FactorOutcome& outcome : outcomes) note(outcome, whole);
  for (const auto& level : plan_.levels) {
    if (whole.status != SolveStatus::Ok) return whole;
    outcomes.assign(level.size(), start);
    parallel_for(
        level.size(),
        [&](std::size_t i) {
          Scratch scratch;
          scratch.outcome = start;
          factor_top(level[i], scratch);
          outcomes[i] = scratch.outcome;
        },
        1);
    for (const FactorOutcome& outcome : outcomes) note(outcome, whole);
  }
  return whole;
}

}  // namespace

template <class T, class N>
FactorOutcome factor_tree(const NumericInput& input, TreeFactor<T>& factor) {
  return Factorizer<T, N>(input, factor).run();
}

template FactorOutcome factor_tree<float, float>(const NumericInput&, TreeFactor<float>&);
template FactorOutcome factor_tree<float, double>(const NumericInput&, TreeFactor<float>&);
template FactorOutcome factor_tree<double, double>(const NumericInput&, TreeFactor<double>&);

}  // namespace piecework::global
