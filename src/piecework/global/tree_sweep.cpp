#include "tree_sweep.hpp"

#include <algorithm>
#include <cstring>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::global {
namespace {

/// Numbers of a block that one task of a large front works on.
constexpr std::ptrdiff_t kTileNumbers = 16384;

template <int kLanes, class T>
void clear(const Lanes<T>& vector, int rows) {
  for (int l = 0; l < kLanes; ++l)
    std::memset(vector.data + l * vector.stride, 0, static_cast<std::size_t>(rows) * sizeof(T));
}

/// L of an ill-conditioned pivot block, in the order in which panels are stored.
template <class T>
class StoredTriangle {
 public:
  StoredTriangle(const T* data, int size, const PanelLayout& layout)
      : data_(data), size_(size), layout_(layout) {}

  /// x = L^-1 x.
  void solve(T* x) const {
    for (int c = 0; c < size_; ++c) {
      x[c] /= at(c, c);
      for (int r = c + 1; r < size_; ++r) x[r] -= at(r, c) * x[c];
    }
  }

  /// x = L^-T x.
  void solve_transposed(T* x) const {
    for (int c = size_; c-- > 0;) {
      for (int r = c + 1; r < size_; ++r) x[c] -= at(r, c) * x[r];
      x[c] /= at(c, c);
    }
  }

 private:
  [[nodiscard]] T at(int row, int column) const {
    const int strip = column / layout_.strip_cols;
    const int cols = std::min(layout_.strip_cols, size_ - strip * layout_.strip_cols);
    const int first = row / layout_.chunk_rows * layout_.chunk_rows;
    const int chunk = std::min(layout_.chunk_rows, size_ - first);
    const T* block = data_ + static_cast<std::size_t>(strip) *
                                 layout_.aligned(static_cast<std::size_t>(size_) *
                                                 static_cast<std::size_t>(layout_.strip_cols));
    return block[first * cols + (column - strip * layout_.strip_cols) * chunk + (row - first)];
  }

  const T* data_;
  int size_;
  const PanelLayout& layout_;
};

}  // namespace

template <class T>
TreeSweep<T>::TreeSweep(const Symbolic& symbolic, const TreePlan& plan, const Kernels<T>& kernels)
    : symbolic_(symbolic), plan_(plan), kernels_(kernels), workspace_(plan.workspace) {}

template <class T>
template <int kLanes>
void TreeSweep<T>::load(int first_column, int count, const VectorView<const double>& b,
                        const Lanes<T>& to) const {
  const int* order = symbolic_.order.data() + first_column;
  if (b.columns == kLanes) {
    for (int i = 0; i < count; ++i) {
      const double* from = b.data + order[i] * b.row_stride;
      for (int l = 0; l < kLanes; ++l)
        to.data[i + l * to.stride] = static_cast<T>(from[l * b.column_stride]);
    }
    return;
  }
  for (int l = 0; l < kLanes; ++l)
    for (int i = 0; i < count; ++i)
      to.data[i + l * to.stride] =
          l < b.columns ? static_cast<T>(b.data[order[i] * b.row_stride + l * b.column_stride])
                        : T(0);
}

template <class T>
template <int kLanes>
void TreeSweep<T>::store(int first_column, int count, const Lanes<T>& from,
                         const VectorView<double>& x) const {
  const int* order = symbolic_.order.data() + first_column;
  if (x.columns == kLanes) {
    for (int i = 0; i < count; ++i) {
      double* to = x.data + order[i] * x.row_stride;
      for (int l = 0; l < kLanes; ++l)
        to[l * x.column_stride] = static_cast<double>(from.data[i + l * from.stride]);
    }
    return;
  }
  for (int l = 0; l < std::min(kLanes, x.columns); ++l)
    for (int i = 0; i < count; ++i)
      x.data[order[i] * x.row_stride + l * x.column_stride] =
          static_cast<double>(from.data[i + l * from.stride]);
}

template <class T>
template <int kLanes>
void TreeSweep<T>::copy(const Lanes<T>& from, int rows, const Lanes<T>& to) const {
  const RowRun all{0, rows};
  sweeps<kLanes>().gather(from, &all, 1, to);
}

/// below -= B own; of a substituted panel, `own` becomes L^-1 own first.
template <class T>
template <int kLanes>
void TreeSweep<T>::forward_panel(const TreeFactor<T>& factor, std::size_t p, const Lanes<T>& own,
                                 const Lanes<T>& below, bool tiled, bool fresh) const {
  const Panel& panel = plan_.panels[p];
  const T* numbers = factor.numbers.data();
  PanelView<T> view{numbers + panel.own,
                    numbers + panel.below,
                    panel.cols,
                    panel.rows,
                    0,
                    panel.rows,
                    true,
                    fresh};
  if (factor.substituted[p]) {
    const StoredTriangle<T> triangle(view.own, panel.cols, kernels_.layout);
    for (int l = 0; l < kLanes; ++l) triangle.solve(own.data + l * own.stride);
  }
  const int tile = tiled ? forward_tile(p) : 0;
  if (tile == 0) {
    sweeps<kLanes>().forward(view, own, below);
    return;
  }
  parallel_for(
      static_cast<std::size_t>(num_forward_tiles(p)),
      [&](std::size_t i) {
        PanelView<T> part = view;
        part.first_row = static_cast<int>(i) * tile;
        part.num_rows = std::min(tile, panel.rows - part.first_row);
        sweeps<kLanes>().forward(part, own, below);
      },
      1);
}

/// out = D^-1 own - B^T below, or L^-T (own - L_below^T below) of a substituted panel.
template <class T>
template <int kLanes>
void TreeSweep<T>::backward_panel(const TreeFactor<T>& factor, std::size_t p, const Lanes<T>& own,
                                  const Lanes<T>& below, const Lanes<T>& out, bool tiled) const {
  const Panel& panel = plan_.panels[p];
  const T* numbers = factor.numbers.data();
  const PanelView<T> view{numbers + panel.own, numbers + panel.below,  panel.cols, panel.rows, 0,
                          panel.rows,          !factor.substituted[p], false};
  const int strips = kernels_.layout.num_strips(panel.cols);
  const int tile = tiled ? backward_tile(p) : 0;
  if (tile == 0) {
    sweeps<kLanes>().backward(view, 0, strips, own, below, out);
  } else {
    parallel_for(
        static_cast<std::size_t>(num_backward_tiles(p)),
        [&](std::size_t i) {
          const int first = static_cast<int>(i) * tile;
          sweeps<kLanes>().backward(view, first, std::min(strips, first + tile), own, below, out);
        },
        1);
  }
  if (view.inverse) return;
  const StoredTriangle<T> triangle(view.own, panel.cols, kernels_.layout);
  for (int l = 0; l < kLanes; ++l) {
    T* x = out.data + l * out.stride;
    for (int c = 0; c < panel.cols; ++c) x[c] += own.data[c + l * own.stride];
    triangle.solve_transposed(x);
  }
}

template <class T>
template <int kLanes>
void TreeSweep<T>::forward_subtree(const TreeFactor<T>& factor, const Subtree& subtree,
                                   const VectorView<const double>& b) {
  const SweepKernels<T>& sweep = sweeps<kLanes>();
  const Lanes<T> local = vector_of(subtree);
  const Lanes<T> scratch{workspace_.data() + subtree.scratch, subtree.scratch_stride};
  load<kLanes>(subtree.first_column, subtree.num_columns, b, local);
  clear<kLanes>(local.at(subtree.num_columns), front(subtree.last_front).num_rows);
  for (int f = subtree.first_front; f <= subtree.last_front; ++f) {
    const Front& shape = front(f);
    const FrontPlan& place = plan(f);
    const Lanes<T> own = local.at(shape.first - subtree.first_column);
    const Lanes<T> below = scratch.at(shape.width);
    if (place.num_panels == 1) {
      forward_panel<kLanes>(factor, place.first_panel, own, below, false, true);
    } else {
      copy<kLanes>(own, shape.width, scratch);
      clear<kLanes>(below, shape.num_rows);
      for (int k = 0; k < place.num_panels; ++k) {
        const std::size_t p = place.first_panel + static_cast<std::size_t>(k);
        const Panel& panel = plan_.panels[p];
        forward_panel<kLanes>(factor, p, scratch.at(panel.first),
                              scratch.at(panel.first + panel.cols), false, false);
      }
      copy<kLanes>(scratch, shape.width, own);
    }
    const RowRun whole{subtree.num_columns, shape.num_rows};
    const bool is_root = f == subtree.last_front;
    sweep.scatter_add(local, is_root ? &whole : plan_.runs.data() + place.first_run,
                      is_root ? 1 : place.num_runs, below);
  }
}

template <class T>
template <int kLanes>
void TreeSweep<T>::backward_subtree(const TreeFactor<T>& factor, const Subtree& subtree,
                                    const VectorView<double>& x) {
  const SweepKernels<T>& sweep = sweeps<kLanes>();
  const Lanes<T> local = vector_of(subtree);
  const Lanes<T> scratch{workspace_.data() + subtree.scratch, subtree.scratch_stride};
  const FrontPlan& root = plan(subtree.last_front);
  if (const int parent = front(subtree.last_front).parent; parent >= 0)
    sweep.gather(vector_of(parent), plan_.runs.data() + root.first_run, root.num_runs,
                 local.at(subtree.num_columns));
  for (int f = subtree.last_front; f >= subtree.first_front; --f) {
    const Front& shape = front(f);
    const FrontPlan& place = plan(f);
    const Lanes<T> own = local.at(shape.first - subtree.first_column);
    const RowRun whole{subtree.num_columns, shape.num_rows};
    const bool is_root = f == subtree.last_front;
    sweep.gather(local, is_root ? &whole : plan_.runs.data() + place.first_run,
                 is_root ? 1 : place.num_runs, scratch.at(shape.width));
    for (int k = place.num_panels; k-- > 0;) {
      const std::size_t p = place.first_panel + static_cast<std::size_t>(k);
      const Panel& panel = plan_.panels[p];
      backward_panel<kLanes>(factor, p, own.at(panel.first), scratch.at(panel.first + panel.cols),
                             scratch.at(panel.first), false);
    }
    copy<kLanes>(scratch, shape.width, own);
  }
  store<kLanes>(subtree.first_column, subtree.num_columns, local, x);
}

template <class T>
Lanes<T> TreeSweep<T>::rows_of_child(int child) const {
  if (plan(child).subtree < 0) return vector_of(child).at(front(child).width);
  const Subtree& subtree = plan_.subtrees[static_cast<std::size_t>(plan(child).subtree)];
  return vector_of(subtree).at(subtree.num_columns);
}

template <class T>
template <int kLanes>
void TreeSweep<T>::forward_top(const TreeFactor<T>& factor, int f,
                               const VectorView<const double>& b) {
  const Front& shape = front(f);
  const FrontPlan& place = plan(f);
  const Lanes<T> vector = vector_of(f);
  if (f == plan_.boundary_front)
    clear<kLanes>(vector, shape.width);
  else
    load<kLanes>(shape.first, shape.width, b, vector);
  clear<kLanes>(vector.at(shape.width), shape.num_rows);
  for (const int child : plan_.children[static_cast<std::size_t>(f)])
    sweeps<kLanes>().scatter_add(vector, plan_.runs.data() + plan(child).first_run,
                                 plan(child).num_runs, rows_of_child(child));
  for (int k = 0; k < place.num_panels; ++k) {
    const std::size_t p = place.first_panel + static_cast<std::size_t>(k);
    const Panel& panel = plan_.panels[p];
    forward_panel<kLanes>(factor, p, vector.at(panel.first), vector.at(panel.first + panel.cols),
                          true, false);
  }
}

template <class T>
template <int kLanes>
void TreeSweep<T>::backward_top(const TreeFactor<T>& factor, int f, const VectorView<double>& x) {
  if (f == plan_.boundary_front) return;
  const Front& shape = front(f);
  const FrontPlan& place = plan(f);
  const Lanes<T> vector = vector_of(f);
  const Lanes<T> solution{workspace_.data() + place.solution, place.stride};
  if (shape.parent >= 0)
    sweeps<kLanes>().gather(vector_of(shape.parent), plan_.runs.data() + place.first_run,
                            place.num_runs, vector.at(shape.width));
  for (int k = place.num_panels; k-- > 0;) {
    const std::size_t p = place.first_panel + static_cast<std::size_t>(k);
    const Panel& panel = plan_.panels[p];
    const Lanes<T> own = vector.at(panel.first);
    backward_panel<kLanes>(factor, p, own, vector.at(panel.first + panel.cols), solution, true);
    copy<kLanes>(solution, panel.cols, own);
  }
  store<kLanes>(shape.first, shape.width, vector, x);
}

template <class T>
void TreeSweep<T>::forward_task(const TreeFactor<T>& factor, std::size_t task,
                                const VectorView<const double>& b) {
  for (const int s : plan_.tasks[task]) {
    const Subtree& subtree = plan_.subtrees[static_cast<std::size_t>(s)];
    if (b.columns == 1)
      forward_subtree<1>(factor, subtree, b);
    else
      forward_subtree<kMaxLanes>(factor, subtree, b);
  }
}

template <class T>
void TreeSweep<T>::backward_task(const TreeFactor<T>& factor, std::size_t task,
                                 const VectorView<double>& x) {
  for (std::size_t s = plan_.tasks[task].size(); s-- > 0;) {
    const Subtree& subtree = plan_.subtrees[static_cast<std::size_t>(plan_.tasks[task][s])];
    if (x.columns == 1)
      backward_subtree<1>(factor, subtree, x);
    else
      backward_subtree<kMaxLanes>(factor, subtree, x);
  }
}

template <class T>
void TreeSweep<T>::forward_front(const TreeFactor<T>& factor, int f,
                                 const VectorView<const double>& b) {
  if (b.columns == 1)
    forward_top<1>(factor, f, b);
  else
    forward_top<kMaxLanes>(factor, f, b);
}

template <class T>
void TreeSweep<T>::backward_front(const TreeFactor<T>& factor, int f, const VectorView<double>& x) {
  if (x.columns == 1)
    backward_top<1>(factor, f, x);
  else
    backward_top<kMaxLanes>(factor, f, x);
}

template <class T>
void TreeSweep<T>::forward(const TreeFactor<T>& factor, const VectorView<const double>& b) {
  parallel_for(
      plan_.tasks.size(), [&](std::size_t t) { forward_task(factor, t, b); }, 1);
  for (const auto& level : plan_.levels)
    parallel_for(
        level.size(), [&](std::size_t i) { forward_front(factor, level[i], b); }, 1);
}

template <class T>
void TreeSweep<T>::backward(const TreeFactor<T>& factor, const VectorView<double>& x) {
  for (std::size_t level = plan_.levels.size(); level-- > 0;)
    parallel_for(
        plan_.levels[level].size(),
        [&](std::size_t i) { backward_front(factor, plan_.levels[level][i], x); }, 1);
  // What the forward sweep touched last is in the caches still.
  const std::size_t last = plan_.tasks.size() - 1;
  parallel_for(
      plan_.tasks.size(), [&](std::size_t t) { backward_task(factor, last - t, x); }, 1);
}

template <class T>
void TreeSweep<T>::solve(const TreeFactor<T>& factor, const VectorView<const double>& b,
                         const VectorView<double>& x) {
  forward(factor, b);
  backward(factor, x);
}

template <class T>
void TreeSweep<T>::solve_with(const TreeFactor<T>& factor, const VectorView<const double>& b,
                              const VectorView<double>& x, TreeSweep& other,
                              const TreeFactor<T>& other_factor,
                              const VectorView<const double>& other_b,
                              const VectorView<double>& other_x) {
  PIECEWORK_ASSERT(other.plan_.factor_numbers == plan_.factor_numbers);
  // One after the other in the loop, not in turns: each thread then reads one factor in order.
  const auto both = [](std::size_t count, const auto& ours, const auto& theirs) {
    parallel_for(
        2 * count, [&](std::size_t i) { i < count ? ours(i) : theirs(i - count); }, 1);
  };
  both(
      plan_.tasks.size(), [&](std::size_t t) { forward_task(factor, t, b); },
      [&](std::size_t t) { other.forward_task(other_factor, t, other_b); });
  for (const auto& level : plan_.levels)
    both(
        level.size(), [&](std::size_t i) { forward_front(factor, level[i], b); },
        [&](std::size_t i) { other.forward_front(other_factor, level[i], other_b); });
  for (std::size_t l = plan_.levels.size(); l-- > 0;)
    both(
        plan_.levels[l].size(),
        [&](std::size_t i) { backward_front(factor, plan_.levels[l][i], x); },
        [&](std::size_t i) { other.backward_front(other_factor, plan_.levels[l][i], other_x); });
  const std::size_t last = plan_.tasks.size() - 1;
  both(
      plan_.tasks.size(), [&](std::size_t t) { backward_task(factor, last - t, x); },
      [&](std::size_t t) { other.backward_task(other_factor, last - t, other_x); });
}

template <class T>
void TreeSweep<T>::profile(const TreeFactor<T>& factor, const VectorView<const double>& b,
                           const VectorView<double>& x, TreeSchedule& schedule) {
  schedule = {};
  schedule.tasks.resize(plan_.tasks.size());
  const auto add_bytes = [&](int f, TreeSchedule::Part& part) {
    for (int k = 0; k < plan(f).num_panels; ++k) {
      const Panel& panel = plan_.panels[plan(f).first_panel + static_cast<std::size_t>(k)];
      const double below = static_cast<double>(panel.rows) * panel.cols * sizeof(T);
      part.forward_bytes += below;
      part.backward_bytes += below + static_cast<double>(panel.cols) * panel.cols * sizeof(T);
    }
  };
  Stopwatch watch;
  for (std::size_t t = 0; t < plan_.tasks.size(); ++t) {
    watch.lap();
    forward_task(factor, t, b);
    schedule.tasks[t].forward_ms = watch.lap();
    for (const int s : plan_.tasks[t]) {
      const Subtree& subtree = plan_.subtrees[static_cast<std::size_t>(s)];
      for (int f = subtree.first_front; f <= subtree.last_front; ++f)
        add_bytes(f, schedule.tasks[t]);
    }
  }
  for (std::size_t level = 0; level < plan_.levels.size(); ++level)
    for (const int f : plan_.levels[level]) {
      TreeSchedule::Front front;
      front.level = static_cast<int>(level);
      front.panels = plan(f).num_panels;
      for (int k = 0; k < front.panels; ++k) {
        const std::size_t p = plan(f).first_panel + static_cast<std::size_t>(k);
        front.forward_tiles = std::max(front.forward_tiles, num_forward_tiles(p));
        front.backward_tiles = std::max(front.backward_tiles, num_backward_tiles(p));
      }
      add_bytes(f, front);
      watch.lap();
      forward_front(factor, f, b);
      front.forward_ms = watch.lap();
      schedule.fronts.push_back(front);
    }
  for (std::size_t i = schedule.fronts.size(); i-- > 0;) {
    const auto level = static_cast<std::size_t>(schedule.fronts[i].level);
    std::size_t first = 0;
    for (std::size_t l = 0; l < level; ++l) first += plan_.levels[l].size();
    watch.lap();
    backward_front(factor, plan_.levels[level][i - first], x);
    schedule.fronts[i].backward_ms = watch.lap();
  }
  for (std::size_t t = plan_.tasks.size(); t-- > 0;) {
    watch.lap();
    backward_task(factor, t, x);
    schedule.tasks[t].backward_ms = watch.lap();
  }
}

/// Rows of a tile, or 0 if the panel is too small to be divided.
template <class T>
int TreeSweep<T>::forward_tile(std::size_t p) const {
  const Panel& panel = plan_.panels[p];
  const int chunk = kernels_.layout.chunk_rows;
  const std::ptrdiff_t size = static_cast<std::ptrdiff_t>(panel.rows) * panel.cols;
  return size < 2 * kTileNumbers
             ? 0
             : static_cast<int>(kTileNumbers / (panel.cols * chunk) + 1) * chunk;
}

/// Strips of a tile, or 0 if the panel is too small to be divided.
template <class T>
int TreeSweep<T>::backward_tile(std::size_t p) const {
  const Panel& panel = plan_.panels[p];
  const std::ptrdiff_t strip =
      static_cast<std::ptrdiff_t>(panel.rows + panel.cols) * kernels_.layout.strip_cols;
  return strip * kernels_.layout.num_strips(panel.cols) < 2 * kTileNumbers
             ? 0
             : static_cast<int>(kTileNumbers / strip) + 1;
}

template <class T>
int TreeSweep<T>::num_forward_tiles(std::size_t p) const {
  const int tile = forward_tile(p);
  return tile == 0 ? 1 : (plan_.panels[p].rows + tile - 1) / tile;
}

template <class T>
int TreeSweep<T>::num_backward_tiles(std::size_t p) const {
  const int tile = backward_tile(p);
  return tile == 0 ? 1 : (kernels_.layout.num_strips(plan_.panels[p].cols) + tile - 1) / tile;
}

template <class T>
void TreeSweep<T>::condense(const TreeFactor<T>& factor, const VectorView<const double>& b,
                            double* boundary) {
  forward(factor, b);
  if (plan_.boundary_front < 0) return;
  const Lanes<T> vector = vector_of(plan_.boundary_front);
  const int rows = symbolic_.num_boundary;
  for (int c = 0; c < b.columns; ++c)
    for (int r = 0; r < rows; ++r)
      boundary[c * rows + r] += static_cast<double>(vector.data[r + c * vector.stride]);
}

template <class T>
void TreeSweep<T>::expand(const TreeFactor<T>& factor, const double* boundary,
                          const VectorView<double>& x) {
  if (plan_.boundary_front >= 0) {
    const Lanes<T> vector = vector_of(plan_.boundary_front);
    const int rows = symbolic_.num_boundary;
    for (int c = 0; c < kMaxLanes; ++c)
      for (int r = 0; r < rows; ++r)
        vector.data[r + c * vector.stride] =
            c < x.columns ? static_cast<T>(boundary[c * rows + r]) : T(0);
  }
  backward(factor, x);
}

template class TreeSweep<float>;
template class TreeSweep<double>;

}  // namespace piecework::global
