#pragma once

// Views of symmetric sparse matrices, as plain spans.

#include <span>
#include <vector>

namespace piecework::global {

/// Pattern of a symmetric |V| x |V| matrix in compressed columns. The entries on and below the
/// diagonal are used; entries above it may be stored as well and are not looked at.
struct SymmetricPattern {
  std::span<const int> column_begin;  ///< |V| + 1
  std::span<const int> row_index;     ///< per entry

  [[nodiscard]] int size() const {
    return column_begin.empty() ? 0 : static_cast<int>(column_begin.size()) - 1;
  }
};

/// Which rows belong together: nodes of a tree in which every two rows with an entry in common lie
/// on one path to the root (the cuts of a domain decomposition do).
struct DomainTree {
  std::span<const int> node_parent;  ///< per node, -1 for the root; parents before children
  std::span<const int> row_node;     ///< per row of the matrix
};

}  // namespace piecework::global
