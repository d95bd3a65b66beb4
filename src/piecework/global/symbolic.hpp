#pragma once

// What a factorisation needs to know before any number is seen: an order of elimination and the
// fronts, dense blocks of columns with a common structure, that form the elimination tree.

#include <cstddef>
#include <span>
#include <vector>

#include <piecework/global/pattern.hpp>
#include <piecework/graph/graph.hpp>

namespace piecework::global {

/// One node of the elimination tree: `width` consecutive columns, all with the same rows below.
struct Front {
  int first = 0;              ///< first column, in order of elimination
  int width = 0;              ///< columns
  int parent = -1;            ///< front of its first row below, -1 for a root
  std::size_t row_begin = 0;  ///< into Symbolic::rows
  int num_rows = 0;           ///< rows below the columns
};

struct Symbolic {
  std::vector<int> order;     ///< position -> row of the matrix
  std::vector<int> position;  ///< row of the matrix -> position
  /// Children before parents; every subtree is a range of fronts and of columns. With a boundary,
  /// the last front holds it, and is not eliminated.
  std::vector<Front> fronts;
  std::vector<int> rows;  ///< ascending positions, front after front
  int num_boundary = 0;
  double nonzeros = 0;  ///< nnz(L) without the zeros that merged fronts store
  double flops = 0;     ///< of one factorisation without them

  [[nodiscard]] int size() const { return static_cast<int>(order.size()); }
  [[nodiscard]] std::span<const int> front_rows(const Front& front) const {
    return std::span(rows).subspan(front.row_begin, static_cast<std::size_t>(front.num_rows));
  }
};

/// When fronts are merged although that stores zeros: where the merged one is cheaper, at
/// `per_front` for each front, `per_row` for each of its rows and 1 for each number it stores and a
/// solve reads. Units: the time for one stored number.
struct MergeCosts {
  double per_front = 300;
  double per_row = 12;
  int leaf_columns = 16;  ///< whole subtrees of no more columns become one front
};

/// Orders and analyses. `boundary` lists rows that are kept to the end and not eliminated.
/// \param order  position -> row, a fill-reducing order; boundary rows may stand anywhere in it.
Symbolic analyze(const graph::Graph& graph, std::span<const int> order,
                 std::span<const int> boundary, const MergeCosts& costs);

/// Fill-reducing order by nested dissection; with `domains`, the cuts between the domains are its
/// top separators and each domain is dissected by itself.
std::vector<int> dissection_order(const graph::Graph& graph, const DomainTree* domains, int seed);

}  // namespace piecework::global
