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
  bool rebuilt = false;  ///< trees built anew, not refitted
  double build_ms = 0;   ///< refit included
  double query_ms = 0;
  std::size_t box_tests = 0;  ///< of pairs of tree nodes and leaves
};

/// Linear bounding volume hierarchies [Karras 2012] over the triangles and edges of a surface,
/// refitted from call to call and rebuilt when they have become bad, by a rule on their boxes, not
/// on clocks. Parallel; the same pairs in the same order for every number of threads.
class BroadPhase {
 public:
  explicit BroadPhase(Surface surface);
  ~BroadPhase();

  [[nodiscard]] const Surface& surface() const;

  /// All pairs that may come within `gap` (m) of each other while every vertex stays in its box
  /// (num_vertices() of them): those whose elements' boxes, unions of their vertices' boxes, come
  /// within `gap` in each coordinate. Left out: pairs that share a vertex, pairs of obstacles, and
  /// pairs of cloth unless Surface::self.
  const CandidatePairs& find(std::span<const VertexBox> boxes, double gap);

  /// Of the last find().
  [[nodiscard]] const BroadPhaseReport& report() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace piecework::collision
