#pragma once

// Numeric multifrontal factorisation over a planned tree. Private to the global module.

#include <memory>
#include <span>
#include <vector>

#include <piecework/global/status.hpp>

#include "tree_plan.hpp"

namespace piecework::global {

/// Numbers that start at 64 bytes and are not initialised.
template <class T>
class AlignedArray {
 public:
  AlignedArray() = default;
  explicit AlignedArray(std::size_t size)
      : data_(static_cast<T*>(::operator new(size * sizeof(T), std::align_val_t(64)))),
        size_(size) {}

  [[nodiscard]] T* data() const { return data_.get(); }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  struct Free {
    void operator()(T* data) const { ::operator delete(data, std::align_val_t(64)); }
  };
  std::unique_ptr<T, Free> data_;
  std::size_t size_ = 0;
};

/// Where a value of the matrix goes in its front.
struct FrontEntry {
  int value;        ///< index into the matrix's values
  unsigned offset;  ///< row + column * (width + rows) in the front
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
  int substituted_panels = 0;           ///< ill-conditioned: kept as L instead of an inverse
  double max_condition = 0;             ///< largest 1-norm condition of an inverted pivot block
};

/// A factor in storage type T, computed in type N.
template <class T>
struct TreeFactor {
  AlignedArray<T> numbers;
  /// Per panel: its blocks hold L and -L_below instead of D^-1 and -B.
  std::vector<char> substituted;
  /// Schur complement onto the boundary, lower triangle, column-major; empty without one.
  std::vector<double> schur;
};

struct NumericInput {
  const Symbolic* symbolic;
  const TreePlan* plan;
  const FrontEntries* entries;
  std::span<const double> values;
  PanelLayout layout;       ///< of the kernels that will read the panels
  double condition_limit;   ///< pivot blocks above are not inverted
};

/// Factors. On failure the factor's contents are void. Parallel over subtrees, then over the fronts
/// of a level and the tiles of large ones; the same numbers for every number of threads.
template <class T, class N>
FactorOutcome factor_tree(const NumericInput& input, TreeFactor<T>& factor);

}  // namespace piecework::global
