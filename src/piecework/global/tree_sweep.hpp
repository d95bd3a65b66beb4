#pragma once

// Forward and backward sweeps over a factored tree. Private to the global module.

#include <piecework/global/tree_schedule.hpp>

#include "tree_factor.hpp"

namespace piecework::global {

/// Up to kMaxLanes right-hand sides in the caller's memory: number c of row i is at
/// data[i * row_stride + c * column_stride].
template <class Value>
struct VectorView {
  Value* data;
  std::ptrdiff_t row_stride;
  std::ptrdiff_t column_stride;
  int columns;
};

/// Everything a solve needs; nothing is allocated during one. Parallel over subtrees, then over the
/// fronts of a level and the strips or rows of large ones; the same bits for every number of
/// threads.
template <class T>
class TreeSweep {
 public:
  TreeSweep(const Symbolic& symbolic, const TreePlan& plan, const Kernels<T>& kernels);

  /// x = K^-1 b; b and x may be the same memory. Not with a boundary.
  void solve(const TreeFactor<T>& factor, const VectorView<const double>& b,
             const VectorView<double>& x);

  /// Two matrices of one pattern at once: half the number of waits of two solves.
  /// \pre other has an equal plan.
  void solve_with(const TreeFactor<T>& factor, const VectorView<const double>& b,
                  const VectorView<double>& x, TreeSweep& other, const TreeFactor<T>& other_factor,
                  const VectorView<const double>& other_b, const VectorView<double>& other_x);

  /// Solves on the calling thread and writes the time of each task and front above the subtrees.
  void profile(const TreeFactor<T>& factor, const VectorView<const double>& b,
               const VectorView<double>& x, TreeSchedule& schedule);

  /// First half: eliminates; adds to `boundary` (num_boundary x columns, column-major) what that
  /// leaves there.
  void condense(const TreeFactor<T>& factor, const VectorView<const double>& b, double* boundary);

  /// Second half, after condense(): from the boundary's solution to all other rows of x.
  void expand(const TreeFactor<T>& factor, const double* boundary, const VectorView<double>& x);

 private:
  void forward(const TreeFactor<T>& factor, const VectorView<const double>& b);
  void backward(const TreeFactor<T>& factor, const VectorView<double>& x);
  void forward_task(const TreeFactor<T>& factor, std::size_t task,
                    const VectorView<const double>& b);
  void backward_task(const TreeFactor<T>& factor, std::size_t task, const VectorView<double>& x);
  void forward_front(const TreeFactor<T>& factor, int f, const VectorView<const double>& b);
  void backward_front(const TreeFactor<T>& factor, int f, const VectorView<double>& x);
  template <int kLanes>
  void load(int first_column, int count, const VectorView<const double>& b,
            const Lanes<T>& to) const;
  template <int kLanes>
  void store(int first_column, int count, const Lanes<T>& from, const VectorView<double>& x) const;
  template <int kLanes>
  void copy(const Lanes<T>& from, int rows, const Lanes<T>& to) const;
  template <int kLanes>
  void forward_subtree(const TreeFactor<T>& factor, const Subtree& subtree,
                       const VectorView<const double>& b);
  template <int kLanes>
  void backward_subtree(const TreeFactor<T>& factor, const Subtree& subtree,
                        const VectorView<double>& x);
  template <int kLanes>
  void forward_top(const TreeFactor<T>& factor, int f, const VectorView<const double>& b);
  template <int kLanes>
  void backward_top(const TreeFactor<T>& factor, int f, const VectorView<double>& x);
  template <int kLanes>
  void forward_panel(const TreeFactor<T>& factor, std::size_t p, const Lanes<T>& own,
                     const Lanes<T>& below, bool tiled, bool fresh) const;
  template <int kLanes>
  void backward_panel(const TreeFactor<T>& factor, std::size_t p, const Lanes<T>& own,
                      const Lanes<T>& below, const Lanes<T>& out, bool tiled) const;

  [[nodiscard]] int forward_tile(std::size_t p) const;
  [[nodiscard]] int backward_tile(std::size_t p) const;
  [[nodiscard]] int num_forward_tiles(std::size_t p) const;
  [[nodiscard]] int num_backward_tiles(std::size_t p) const;

  template <int kLanes>
  [[nodiscard]] const SweepKernels<T>& sweeps() const {
    return kLanes == 1 ? kernels_.one : kernels_.three;
  }
  [[nodiscard]] const FrontPlan& plan(int f) const {
    return plan_.fronts[static_cast<std::size_t>(f)];
  }
  [[nodiscard]] const Front& front(int f) const {
    return symbolic_.fronts[static_cast<std::size_t>(f)];
  }
  [[nodiscard]] Lanes<T> vector_of(int f) const {
    return {workspace_.data() + plan(f).vector, plan(f).stride};
  }
  [[nodiscard]] Lanes<T> vector_of(const Subtree& subtree) const {
    return {workspace_.data() + subtree.vector, subtree.stride};
  }
  [[nodiscard]] Lanes<T> rows_of_child(int child) const;

  const Symbolic& symbolic_;
  const TreePlan& plan_;
  const Kernels<T>& kernels_;
  AlignedArray<T> workspace_;
};

}  // namespace piecework::global
