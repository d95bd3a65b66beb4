#pragma once

// Numeric multifrontal factorisation over a planned tree. Private to the global module.

#include <algorithm>
#include <span>
#include <vector>

#include <piecework/global/status.hpp>

#include "aligned_array.hpp"
#include "tree_plan.hpp"

namespace piecework::global {

/// From column to column of a front's matrix of `size` rows.
inline int front_stride(int size) { return (size + 15) / 16 * 16; }

/// Where a value of the matrix goes in its front.
struct FrontEntry {
  int value;        ///< index into the matrix's values
  unsigned offset;  ///< row + column * front_stride(width + rows) in the front
};

/// The entries of every front, found once per pattern.
struct FrontEntries {
  std::vector<std::size_t> begin;  ///< per front, and the end
  std::vector<FrontEntry> entries;
};

FrontEntries scatter_entries(const SymmetricPattern& pattern, const Symbolic& symbolic);

/// What became of a factorisation, besides its numbers.
struct FactorOutcome {
  SolveStatus status = SolveStatus::Ok;
  double min_pivot = 0, max_pivot = 0;  ///< of L's diagonal
  double smallest_pivot = 1;            ///< relative: smallest L_ii^2 / K_ii
  int substituted_panels = 0;           ///< ill-conditioned: kept as L instead of an inverse
  /// Largest condition of an inverted pivot block D, estimated as the largest entry on D's diagonal
  /// times the 1-norm of D^-1.
  double max_condition = 0;
};

/// Update matrices of roots of subtrees and of the fronts above them, in type N: kept, they let a
/// part of the tree be factored anew.
template <class N>
using UpdateMatrices = std::vector<AlignedArray<N>>;

/// A factor in storage type T.
template <class T>
struct TreeFactor {
  AlignedArray<T> numbers;
  /// Per panel: its blocks hold L and -L_below instead of D^-1 and -B.
  std::vector<char> substituted;
  /// Schur complement onto the boundary, lower triangle, column-major; empty without one.
  std::vector<double> schur;

  [[nodiscard]] int num_substituted() const {
    return static_cast<int>(std::count(substituted.begin(), substituted.end(), 1));
  }
};

struct NumericInput {
  const Symbolic* symbolic;
  const TreePlan* plan;
  const FrontEntries* entries;
  std::span<const double> values;
  std::span<const double> diagonal;  ///< K_ii in order of elimination
  PanelLayout layout;                ///< of the kernels that will read the panels
  Isa isa;                           ///< for the dense kernels
  double condition_limit;            ///< pivot blocks above are not inverted
};

/// Which part of the tree is factored anew.
struct Scope {
  /// Per front: its entries or those of a front below it have changed. Empty: all.
  std::span<const char> changed;
  bool keep_updates = false;  ///< for a later call with `changed`
  /// Per front, or empty: with `changed`, its update matrix stays what it is.
  std::span<const char> frozen;
};

/// Factors. On failure the factor's contents are void. Parallel over subtrees, then over the fronts
/// of a level and the tiles of large ones; the same numbers for every number of threads.
/// The outcome is that of the part in scope.
template <class T, class N>
FactorOutcome factor_tree(const NumericInput& input, const Scope& scope, TreeFactor<T>& factor,
                          UpdateMatrices<N>& updates);

}  // namespace piecework::global
