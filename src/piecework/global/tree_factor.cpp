#include "tree_factor.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

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
        const auto stride = static_cast<unsigned>(front_stride(front.width + front.num_rows));
        for (std::size_t e = result.begin[f]; e < result.begin[f + 1]; ++e) {
          const int row = row_of[e];
          const auto local = static_cast<unsigned>(
              row < front.first + front.width
                  ? row - front.first
                  : front.width + (std::lower_bound(rows.begin(), rows.end(), row) - rows.begin()));
          const unsigned column = result.entries[e].offset - static_cast<unsigned>(front.first);
          result.entries[e].offset = local + column * stride;
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

/// Up to this many rows our own kernels do everything; beyond, BLAS updates what is right of a
/// panel.
constexpr int kSmallFront = 224;

/// A front's matrix: (width + rows)^2, column-major, lower triangle.
template <class N>
struct FrontMatrix {
  N* data;
  int width;
  int rows;
  [[nodiscard]] int size() const { return width + rows; }
  [[nodiscard]] int stride() const { return front_stride(size()); }
  [[nodiscard]] N* at(int row, int column) const {
    return data + static_cast<std::size_t>(column) * static_cast<std::size_t>(stride()) + row;
  }
  [[nodiscard]] static std::size_t numbers(const Front& front) {
    const int size = front.width + front.num_rows;
    return static_cast<std::size_t>(size) * static_cast<std::size_t>(front_stride(size));
  }
};

template <class T, class N>
class Factorizer {
 public:
  Factorizer(const NumericInput& input, const Scope& scope, TreeFactor<T>& factor,
             UpdateMatrices<N>& updates)
      : input_(input),
        scope_(scope),
        symbolic_(*input.symbolic),
        plan_(*input.plan),
        kernels_(kernels<N>(input.isa)),
        factor_(factor),
        updates_(updates) {
    PIECEWORK_ASSERT(input.layout.strip_cols == kernels_.layout.strip_cols &&
                     input.layout.chunk_rows % kernels_.layout.chunk_rows == 0);
  }

  FactorOutcome run();

 private:
  struct Scratch {
    AlignedArray<N> front, panel, block;
    std::vector<RowRun> runs;
    AlignedArray<N> stack;
    FactorOutcome outcome;
    N* front_of(std::size_t count) { return grow(front, count); }
    N* panel_of(std::size_t count) { return grow(panel, count); }
    N* block_of(std::size_t count) { return grow(block, count); }
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
                  std::vector<RowRun>& runs);
  bool eliminate(int f, const FrontMatrix<N>& matrix, bool tiled, Scratch& scratch);
  static void copy_update(const FrontMatrix<N>& matrix, N* out);
  void keep_update(int f, const FrontMatrix<N>& matrix);
  void update_trailing(const FrontMatrix<N>& matrix, int first, int end, int last, bool tiled);
  void store_panel(std::size_t p, const FrontMatrix<N>& matrix, double diagonal, Scratch& scratch);
  void pack(const N* from, int ld, int rows, int cols, N sign, T* to) const;
  void repack(const N* from, int rows, int cols, T* to) const;
  void note(const FactorOutcome& part, FactorOutcome& whole) const;

  [[nodiscard]] bool in_scope(int f) const {
    return scope_.changed.empty() || scope_.changed[static_cast<std::size_t>(f)] != 0;
  }

  [[nodiscard]] bool frozen(int f) const {
    return !scope_.changed.empty() && !scope_.frozen.empty() &&
           scope_.frozen[static_cast<std::size_t>(f)] != 0;
  }

  const NumericInput& input_;
  const Scope& scope_;
  const Symbolic& symbolic_;
  const TreePlan& plan_;
  const Kernels<N>& kernels_;
  TreeFactor<T>& factor_;
  UpdateMatrices<N>& updates_;
};

/// Largest sum of magnitudes of a column.
template <class N>
double norm1(int n, const N* a, int lda) {
  N largest = 0;
  for (int c = 0; c < n; ++c) {
    const N* column = a + static_cast<std::size_t>(c) * static_cast<std::size_t>(lda);
    N sums[8] = {};
    int r = 0;
    for (; r + 8 <= n; r += 8)
      for (int i = 0; i < 8; ++i) sums[i] += std::abs(column[r + i]);
    N sum = 0;
    for (; r < n; ++r) sum += std::abs(column[r]);
    for (const N part : sums) sum += part;
    largest = sum > largest || std::isnan(sum) ? sum : largest;
  }
  return static_cast<double>(largest);
}

template <class T, class N>
void Factorizer<T, N>::assemble(int f, const FrontMatrix<N>& matrix) {
  const int stride = matrix.stride();
  for (int c = 0; c < matrix.size(); ++c) {  // from the chunk of the diagonal down
    const int first = c / 16 * 16;
    std::memset(matrix.at(first, c), 0, static_cast<std::size_t>(stride - first) * sizeof(N));
  }
  const FrontEntries& entries = *input_.entries;
  for (std::size_t e = entries.begin[static_cast<std::size_t>(f)];
       e < entries.begin[static_cast<std::size_t>(f) + 1]; ++e)
    matrix.data[entries.entries[e].offset] +=
        static_cast<N>(input_.values[static_cast<std::size_t>(entries.entries[e].value)]);
}

/// Adds a child's update matrix, by runs of rows that stay together.
template <class T, class N>
void Factorizer<T, N>::extend_add(int child, const N* update, int parent,
                                  const FrontMatrix<N>& matrix, std::vector<RowRun>& runs) {
  const auto rows = symbolic_.front_rows(front(child));
  const auto parent_rows = symbolic_.front_rows(front(parent));
  const int first = front(parent).first;
  runs.clear();
  std::size_t k = 0;
  for (const int row : rows) {
    int place = row - first;
    if (place >= matrix.width) {
      while (parent_rows[k] != row) ++k;
      place = matrix.width + static_cast<int>(k);
    }
    if (!runs.empty() && runs.back().start + runs.back().length == place)
      ++runs.back().length;
    else
      runs.push_back({place, 1});
  }
  kernels_.dense.extend_add(matrix.data, matrix.stride(), update, static_cast<int>(rows.size()),
                            runs.data(), static_cast<int>(runs.size()));
}

/// Lower triangle of columns end ... last - 1 and the rows below -= L L^T with L's columns
/// first ... end - 1.
template <class T, class N>
void Factorizer<T, N>::update_trailing(const FrontMatrix<N>& matrix, int first, int end, int last,
                                       bool tiled) {
  const int rest = matrix.size() - end;
  const int depth = end - first;
  if (last == end) return;
  if (!tiled) {
    dense::subtract_square<N>(last - end, depth, matrix.at(end, first), matrix.stride(),
                              matrix.at(end, end), matrix.stride());
    dense::subtract_product<N>(matrix.size() - last, last - end, depth, matrix.at(last, first),
                               matrix.stride(), matrix.at(end, first), matrix.stride(),
                               matrix.at(last, end), matrix.stride());
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
        const int cols = std::min(kTile, last - c);
        if (cols <= 0) return;
        if (row == column && cols == rows)
          dense::subtract_square<N>(rows, depth, matrix.at(r, first), matrix.stride(),
                                    matrix.at(r, c), matrix.stride());
        else
          dense::subtract_product<N>(rows, cols, depth, matrix.at(r, first), matrix.stride(),
                                     matrix.at(c, first), matrix.stride(), matrix.at(r, c),
                                     matrix.stride());
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

/// The same from a block that is in the order of N's kernels.
template <class T, class N>
void Factorizer<T, N>::repack(const N* from, int rows, int cols, T* to) const {
  const PanelLayout& layout = input_.layout;
  const int strip = layout.strip_cols;
  const int small = kernels_.layout.chunk_rows;
  for (int first = 0; first < cols; first += strip) {
    const int count = std::min(strip, cols - first);
    const N* in = from + kernels_.layout.block_size(rows, first);
    T* out = to + layout.block_size(rows, first);
    for (int r = 0; r < rows; r += small) {
      const int length = std::min(small, rows - r);
      const int begin = r / layout.chunk_rows * layout.chunk_rows;
      const int chunk = std::min(layout.chunk_rows, rows - begin);
      for (int c = 0; c < count; ++c, in += length)
        std::copy_n(in, length, out + begin * count + c * chunk + (r - begin));
    }
  }
}

/// Writes panel p, whose columns of L are done, in the form that the sweeps read. `diagonal`: the
/// largest entry that D had on its diagonal.
template <class T, class N>
void Factorizer<T, N>::store_panel(std::size_t p, const FrontMatrix<N>& matrix, double diagonal,
                                   Scratch& scratch) {
  const Panel& panel = plan_.panels[p];
  const int cols = panel.cols;
  const N* l_own = matrix.at(panel.first, panel.first);
  const N* l_below = matrix.at(panel.first + cols, panel.first);
  T* own = factor_.numbers.data() + panel.own;
  T* below = factor_.numbers.data() + panel.below;
  const int stride = front_stride(cols);
  const auto square = static_cast<std::size_t>(cols) * static_cast<std::size_t>(stride);
  N* l_inverse = scratch.panel_of(3 * square);
  N* inverse = l_inverse + square;
  kernels_.dense.invert(l_own, matrix.stride(), cols, l_inverse, stride);
  kernels_.dense.square(l_inverse, stride, cols, inverse, stride, inverse + square);
  const double condition = diagonal * norm1(cols, inverse, stride);
  const bool substitute = !(condition <= input_.condition_limit);
  factor_.substituted[p] = substitute;
  if (substitute) {
    ++scratch.outcome.substituted_panels;
    pack(l_own, matrix.stride(), cols, cols, N(1), own);
    pack(l_below, matrix.stride(), panel.rows, cols, N(-1), below);
    return;
  }
  scratch.outcome.max_condition = std::max(scratch.outcome.max_condition, condition);
  pack(inverse, stride, cols, cols, N(1), own);
  const auto multiply = [&](N* out) {
    kernels_.dense.multiply(l_below, matrix.stride(), panel.rows, l_inverse, stride, cols, out);
  };
  if constexpr (std::is_same_v<T, N>) {
    multiply(below);
  } else {
    N* block = scratch.block_of(kernels_.layout.block_size(panel.rows, cols));
    multiply(block);
    repack(block, panel.rows, cols, below);
  }
}

/// Factors the front's own columns, panel by panel; its update matrix is left below them.
template <class T, class N>
bool Factorizer<T, N>::eliminate(int f, const FrontMatrix<N>& matrix, bool tiled,
                                 Scratch& scratch) {
  const FrontPlan& plan = plan_.fronts[static_cast<std::size_t>(f)];
  const int last = frozen(f) ? matrix.width : matrix.size();
  for (int k = 0; k < plan.num_panels; ++k) {
    const std::size_t p = plan.first_panel + static_cast<std::size_t>(k);
    const Panel& panel = plan_.panels[p];
    const int end = panel.first + panel.cols;
    double diagonal = 0;
    for (int c = panel.first; c < end; ++c)
      diagonal = std::max(diagonal, static_cast<double>(*matrix.at(c, c)));
    const bool small = matrix.size() <= kSmallFront;
    if (!kernels_.dense.eliminate(matrix.at(0, 0), matrix.size(), matrix.stride(), panel.first, end,
                                  small ? last : end))
      return false;
    for (int c = panel.first; c < end; ++c) {
      const auto pivot = static_cast<double>(*matrix.at(c, c));
      scratch.outcome.min_pivot = std::min(scratch.outcome.min_pivot, pivot);
      scratch.outcome.max_pivot = std::max(scratch.outcome.max_pivot, pivot);
      scratch.outcome.smallest_pivot =
          std::min(scratch.outcome.smallest_pivot,
                   pivot * pivot / input_.diagonal[static_cast<std::size_t>(front(f).first + c)]);
    }
    if (!small) update_trailing(matrix, panel.first, end, last, tiled);
    store_panel(p, matrix, diagonal, scratch);
  }
  return true;
}

/// The lower triangle of what an eliminated front leaves to its parent.
template <class T, class N>
void Factorizer<T, N>::copy_update(const FrontMatrix<N>& matrix, N* out) {
  const auto rows = static_cast<std::size_t>(matrix.rows);
  for (std::size_t c = 0; c < rows; ++c) {
    const int diagonal = matrix.width + static_cast<int>(c);
    std::copy_n(matrix.at(diagonal, diagonal), rows - c, out + c * rows + c);
  }
}

template <class T, class N>
void Factorizer<T, N>::keep_update(int f, const FrontMatrix<N>& matrix) {
  if (frozen(f)) return;
  const auto rows = static_cast<std::size_t>(matrix.rows);
  auto& update = updates_[static_cast<std::size_t>(f)];
  if (update.size() != rows * rows) update = AlignedArray<N>(rows * rows);
  copy_update(matrix, update.data());
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
    const FrontMatrix<N> matrix{scratch.front_of(FrontMatrix<N>::numbers(current)), current.width,
                                current.num_rows};
    assemble(f, matrix);
    // Children lie on the stack in order; the first one deepest.
    const auto& children = plan_.children[static_cast<std::size_t>(f)];
    for (const int child : children) top -= square(child);
    const N* update = top;
    for (const int child : children) {
      extend_add(child, update, f, matrix, scratch.runs);
      update += square(child);
    }
    if (!eliminate(f, matrix, false, scratch)) {
      scratch.outcome.status = SolveStatus::NotPositiveDefinite;
      return;
    }
    if (f == subtree.last_front) {
      keep_update(f, matrix);
    } else {
      copy_update(matrix, top);
      top += square(f);
    }
  }
}

template <class T, class N>
void Factorizer<T, N>::factor_top(int f, Scratch& scratch) {
  const Front& current = front(f);
  const FrontMatrix<N> matrix{scratch.front_of(FrontMatrix<N>::numbers(current)), current.width,
                              current.num_rows};
  assemble(f, matrix);
  for (const int child : plan_.children[static_cast<std::size_t>(f)]) {
    extend_add(child, updates_[static_cast<std::size_t>(child)].data(), f, matrix, scratch.runs);
    if (!scope_.keep_updates) updates_[static_cast<std::size_t>(child)] = {};
  }
  if (f == plan_.boundary_front) {
    const auto size = static_cast<std::size_t>(matrix.size());
    factor_.schur.resize(size * size);
    for (std::size_t c = 0; c < size; ++c)
      std::copy_n(matrix.at(0, static_cast<int>(c)), size, factor_.schur.data() + c * size);
    return;
  }
  if (!eliminate(f, matrix, matrix.size() >= kTiledFront, scratch)) {
    scratch.outcome.status = SolveStatus::NotPositiveDefinite;
    return;
  }
  keep_update(f, matrix);
}

template <class T, class N>
void Factorizer<T, N>::note(const FactorOutcome& part, FactorOutcome& whole) const {
  if (part.status != SolveStatus::Ok) whole.status = part.status;
  whole.min_pivot = std::min(whole.min_pivot, part.min_pivot);
  whole.max_pivot = std::max(whole.max_pivot, part.max_pivot);
  whole.smallest_pivot = std::min(whole.smallest_pivot, part.smallest_pivot);
  whole.max_condition = std::max(whole.max_condition, part.max_condition);
  whole.substituted_panels += part.substituted_panels;
}

template <class T, class N>
FactorOutcome Factorizer<T, N>::run() {
  dense::use_one_thread();
  if (factor_.numbers.size() != plan_.factor_numbers)
    factor_.numbers = AlignedArray<T>(plan_.factor_numbers);
  factor_.substituted.resize(plan_.panels.size(), 0);
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
          const Subtree& subtree = plan_.subtrees[static_cast<std::size_t>(s)];
          if (in_scope(subtree.last_front)) factor_subtree(subtree, scratch);
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
          if (in_scope(level[i])) factor_top(level[i], scratch);
          outcomes[i] = scratch.outcome;
        },
        1);
    for (const FactorOutcome& outcome : outcomes) note(outcome, whole);
  }
  return whole;
}

}  // namespace

template <class T, class N>
FactorOutcome factor_tree(const NumericInput& input, const Scope& scope, TreeFactor<T>& factor,
                          UpdateMatrices<N>& updates) {
  const FactorOutcome outcome = Factorizer<T, N>(input, scope, factor, updates).run();
  if (!scope.keep_updates || outcome.status != SolveStatus::Ok) updates.clear();
  return outcome;
}

template FactorOutcome factor_tree<float, float>(const NumericInput&, const Scope&,
                                                 TreeFactor<float>&, UpdateMatrices<float>&);
template FactorOutcome factor_tree<float, double>(const NumericInput&, const Scope&,
                                                  TreeFactor<float>&, UpdateMatrices<double>&);
template FactorOutcome factor_tree<double, double>(const NumericInput&, const Scope&,
                                                   TreeFactor<double>&, UpdateMatrices<double>&);

}  // namespace piecework::global
