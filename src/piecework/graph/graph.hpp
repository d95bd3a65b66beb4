#pragma once

// Undirected graphs in compressed rows, and METIS behind one door: two-way splits and
// fill-reducing orderings. METIS draws from one global random state: its calls are never made from
// two threads at a time, and each sets its seed first.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace piecework::graph {

/// Neighbours of node v: neighbor[begin[v]] ... neighbor[begin[v + 1] - 1]; both directions of an
/// edge are stored, no loops.
struct Graph {
  std::vector<int> begin{0};
  std::vector<int> neighbor;

  [[nodiscard]] int size() const { return static_cast<int>(begin.size()) - 1; }
  [[nodiscard]] std::span<const int> neighbors(int node) const {
    const auto first = static_cast<std::size_t>(begin[static_cast<std::size_t>(node)]);
    const auto last = static_cast<std::size_t>(begin[static_cast<std::size_t>(node) + 1]);
    return std::span(neighbor).subspan(first, last - first);
  }
};

/// The graph of a symmetric matrix in compressed columns (one or both triangles stored, entries
/// sorted or not): an edge for each off-diagonal pair. Neighbours ascend.
/// \pre 0 <= row < size for every entry.
Graph graph_of_pattern(std::span<const int> column_begin, std::span<const int> row_index);

/// The part of `graph` between `nodes`, numbered as listed. `scratch` must be -1 everywhere, one
/// per node of `graph`, and is left so.
Graph subgraph(const Graph& graph, std::span<const int> nodes, std::vector<int>& scratch);

/// Splits a connected graph in two with METIS; side[v] is 0 or 1. False if METIS made only one
/// part. `share` is the first part's share of the weight.
bool bisect(const Graph& graph, std::span<const std::int32_t> weight, double share, int seed,
            std::vector<std::int32_t>& side);

/// Fill-reducing order by nested dissection (METIS): position -> node.
std::vector<int> nested_dissection(const Graph& graph, int seed);

/// Nodes in the order of a breadth-first walk from one end of the graph to the other, component
/// after component: neighbours come close to each other.
std::vector<int> linear_order(const Graph& graph);

/// "METIS 5.1.0".
std::string metis_version();

}  // namespace piecework::graph
