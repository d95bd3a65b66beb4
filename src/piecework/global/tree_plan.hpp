#pragma once

// How a tree of fronts is stored and traversed: panels, vectors, subtrees that are one task each,
// and the top of the tree above them. Private to the global module. Depends on the matrix only,
// never on the number of threads.

#include <cstddef>
#include <vector>

#include <piecework/global/symbolic.hpp>

#include "kernels.hpp"

namespace piecework::global {

/// A block of a front's columns with its own pivot block D.
struct Panel {
  int first = 0;          ///< first of its columns, in the front
  int cols = 0;           ///< columns
  int rows = 0;           ///< rows below: the front's later columns and the rows below the front
  std::size_t own = 0;    ///< where D^-1 starts in the factor's storage
  std::size_t below = 0;  ///< where -B starts
};

/// A front with its place in the traversal. Its vector has its columns and then its rows below.
struct FrontPlan {
  int num_panels = 0;
  std::size_t first_panel = 0;
  /// Rows below as runs in the vector of the subtree (fronts inside one) or of the parent front
  /// (roots of subtrees, fronts above them).
  std::size_t first_run = 0;
  int num_runs = 0;
  int subtree = -1;          ///< -1: above the subtrees
  std::size_t vector = 0;    ///< above the subtrees: where its vector starts in the workspace
  std::size_t solution = 0;  ///< where the backward sweep collects the columns of a panel
  int stride = 0;            ///< from lane to lane of both
};

/// A subtree below the top: solved by one task at a time in a vector of its own, which holds the
/// columns of all its fronts and then the rows below its root.
struct Subtree {
  int first_front = 0;
  int last_front = 0;  ///< its root
  int first_column = 0;
  int num_columns = 0;
  std::size_t vector = 0;   ///< where its vector starts in the workspace
  int stride = 0;           ///< from lane to lane
  std::size_t scratch = 0;  ///< workspace for the vector of one front at a time
  int scratch_stride = 0;
};

struct PlanOptions {
  // Chosen by measurement: narrow panels store no more numbers (a triangle of B replaces a square
  // of D^-1), and above the subtrees each panel is a step that all threads wait for.
  int panel_columns = 32;          ///< inside subtrees
  int top_panel_columns = 64;      ///< above them
  double subtree_numbers = 1.2e5;  ///< factor numbers of a subtree at most
  double task_numbers = 6e4;       ///< small subtrees share tasks of about this size
};

struct TreePlan {
  std::vector<Panel> panels;
  std::vector<FrontPlan> fronts;
  std::vector<RowRun> runs;
  std::vector<Subtree> subtrees;
  std::vector<std::vector<int>> tasks;   ///< subtrees of each task
  std::vector<std::vector<int>> levels;  ///< fronts above the subtrees, children before parents
  /// Per front: its children in order; inside subtrees too.
  std::vector<std::vector<int>> children;
  std::size_t factor_numbers = 0;  ///< of the factor's storage
  std::size_t own_begin = 0;       ///< from here on it holds pivot blocks
  std::size_t workspace = 0;       ///< numbers of all vectors
  int boundary_front = -1;         ///< front that is not eliminated, -1 without
};

TreePlan plan_tree(const Symbolic& symbolic, const PlanOptions& options, const PanelLayout& layout);

/// Flags of fronts, none below another, whose subtrees are the interiors of at least `count`
/// domains; fronts inside the plan's subtrees are never chosen. 0: no flags.
std::vector<char> interior_roots(const Symbolic& symbolic, const TreePlan& plan, int count);

}  // namespace piecework::global
