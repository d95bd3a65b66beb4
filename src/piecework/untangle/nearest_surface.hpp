#pragma once

// The way out of a closed mesh. Private to `untangle`.

#include <array>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::untangle {

/// Normal of a triangle, twice its area long, m^2.
inline Vec3 area_normal(const Triangle& t, const Positions& x) {
  const Vec3 a = x.row(t[0]), b = x.row(t[1]), c = x.row(t[2]);
  return (b - a).cross(c - a);
}

/// The triangles of a closed mesh between its inside and its outside, for queries of the nearest
/// point: where pieces of the mesh overlap, what lies in another piece is no way out. A binary tree
/// of boxes, halved by the number of triangles.
class NearestSurface {
 public:
  /// \param x  positions, m; both are kept
  NearestSurface(const Triangles& triangles, const Positions& x);

  struct Foot {
    Vec3 point;    ///< m
    Vec3 outward;  ///< unit normal of its triangle; zero if that has no area
  };
  /// The nearest point of the surface. Of several the one that the tree meets first.
  /// \pre the mesh has an outside
  [[nodiscard]] Foot nearest(const Vec3& p) const;

  [[nodiscard]] bool empty() const { return triangles_.empty(); }

 private:
  struct Node {
    Vec3 low, high;
    int begin, end;  ///< triangles
    int right;       ///< second child, the first follows its parent; 0: a leaf
  };
  int build(int begin, int end);
  [[nodiscard]] double box_distance_sq(int node, const Vec3& p) const;

  Triangles triangles_;  ///< in the order of the leaves, counter-clockwise seen from outside
  Positions x_;
  std::vector<Node> nodes_;
};

}  // namespace piecework::untangle
