#pragma once

// Connected two-way splits of sets of triangles. Private to the decomposition module.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <piecework/graph/graph.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::decomposition {

/// Triangles as a graph: edge neighbours (-1 where there is none), neighbours across seams, and
/// integer weights.
struct TriangleGraph {
  std::vector<std::array<int, 3>> neighbors;
  mesh::Adjacency across;  ///< per triangle; empty: no seams
  std::vector<std::int32_t> weight;

  /// Calls visit(other) for every neighbour of a triangle.
  template <class Visit>
  void visit_neighbors(int triangle, const Visit& visit) const {
    const auto t = static_cast<std::size_t>(triangle);
    for (const int other : neighbors[t])
      if (other >= 0) visit(other);
    if (across.begin.empty()) return;
    for (int k = across.begin[t]; k < across.begin[t + 1]; ++k)
      visit(across.item[static_cast<std::size_t>(k)]);
  }
};

/// Splits connected sets of triangles into two connected parts, reusing its buffers.
class Bisector {
 public:
  Bisector(const TriangleGraph& graph, int seed);

  /// Reorders `set` so that its first part comes first, and returns the size of that part
  /// (at least 1, at most set.size() - 1). Both parts are connected; the first one's share of the
  /// weight is close to `share`.
  /// \pre set.size() >= 2 and its triangles are connected through the graph.
  std::size_t split(std::span<int> set, double share);

 private:
  void extract(std::span<const int> set);
  int breadth_first(int start);
  void split_by_growing(int start, double share);
  void improve_by_growing(double share);
  void keep_largest_part(int side);
  void make_connected();
  void rebalance(double share);
  void grow(int side, double missing);
  [[nodiscard]] double imbalance(double share) const;

  const TriangleGraph& graph_;
  int seed_;
  std::vector<int> local_;  ///< global triangle -> index in the current set, -1 outside
  graph::Graph set_;        ///< the current set
  std::vector<std::int32_t> weight_, side_;
  std::vector<int> visited_, queue_;
};

}  // namespace piecework::decomposition
