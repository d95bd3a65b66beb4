#pragma once

// Which pairs of a surface can come close, by bounding volumes.

#include <memory>
#include <span>
#include <vector>

#include <piecework/collision/distance.hpp>
#include <piecework/collision/surface.hpp>

namespace piecework::collision {

/// Axis-aligned box of one vertex' whereabouts, m.
struct VertexBox {
  Vec3 low, high;
};

/// A vertex and a triangle, or two edges, by their numbers in the Surface.
struct PairIndex {
  int a, b;
  bool operator==(const PairIndex&) const = default;
  auto operator<=>(const PairIndex&) const = default;
};

struct CandidatePairs {
  std::vector<PairIndex> vertex_triangle;  ///< (vertex, triangle), ascending
  std::vector<PairIndex> edge_edge;        ///< (edge, edge), first < second, ascending
};

struct BroadPhaseReport {
  bool rebuilt = false;  ///< trees of cloth or obstacles built anew, not refitted
  double build_ms = 0;   ///< refit included
  double query_ms = 0;
  std::size_t box_tests = 0;  ///< pairs of boxes compared: of nodes, leaves and elements
};

/// Linear bounding volume hierarchies [Karras 2012] over the triangles and edges of a surface,
/// those of cloth apart from those of obstacles. Their boxes are refitted from call to call
/// (obstacles at rest: not even that), and a body's trees are built anew when their boxes have
/// become bad, by a rule on surface areas, not on clocks. Parallel; the same pairs in the same
/// order for every number of threads and every instruction set. Buffers are kept: calls that find
/// no more pairs than earlier ones and build no trees allocate nothing for them.
class BroadPhase {
 public:
  explicit BroadPhase(Surface surface);
  ~BroadPhase();

  [[nodiscard]] const Surface& surface() const;

  /// All pairs that may come within `gap` (m) of each other while every vertex stays in its box
  /// (num_vertices() of them): those whose elements' boxes, unions of their vertices' boxes, come
  /// within `gap` in each coordinate. Left out: pairs that share a vertex, pairs of obstacles, and
  /// pairs of cloth unless Surface::self. Decided in double precision: "within" means
  /// low_a - high_b <= gap and low_b - high_a <= gap as doubles. The result lives until the next
  /// call. \throws SimulationError that names the vertex if a box is empty (low > high), not finite
  /// or
  ///         beyond 1e100 m, or if the gap is negative or not finite; earlier pairs are kept then
  const CandidatePairs& find(std::span<const VertexBox> boxes, double gap);

  /// Of the last find().
  [[nodiscard]] const BroadPhaseReport& report() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace piecework::collision
