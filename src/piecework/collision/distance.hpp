#pragma once

// Closest points of a vertex and a triangle, and of two edges.
//
// A pair has four vertices in a fixed order: vertex, then triangle (VT), or edge, then edge (EE).
// Its closest points are combinations of them, so that
//     offset = sum_i beta_i x_i,   distance = |offset|,   sum_i beta_i = 0
// with beta = (1, -b1, -b2, -b3) for VT and (1 - s, s, -(1 - u), -u) for EE. By the envelope
// theorem d distance / d x_i = beta_i offset / distance wherever the closest points are unique.

#include <array>
#include <cstdint>

#include <piecework/core/types.hpp>

namespace piecework::collision {

enum class PairKind : std::uint8_t { VertexTriangle, EdgeEdge };

/// Vertices of a pair, in the order above.
using PairVertices = std::array<int, 4>;
using PairPoints = std::array<Vec3, 4>;  ///< m

struct Closest {
  std::array<double, 4> beta;  ///< b_i, s, u in [0, 1]
  Vec3 offset;                 ///< from the second closest point to the first, m
  double distance_sq;          ///< |offset|^2, m^2
};

/// Closest points of vertex x[0] and triangle x[1] x[2] x[3], which may be degenerate (zero area,
/// zero length): then those of its edges or of its corner. No input is refused; non-finite points
/// give a non-finite distance.
Closest closest_vertex_triangle(const PairPoints& x);

/// Closest points of the segments x[0] x[1] and x[2] x[3], which may be parallel or of zero length.
/// Where they are not unique (parallel overlap), one pair of them.
Closest closest_edge_edge(const PairPoints& x);

inline Closest closest(PairKind kind, const PairPoints& x) {
  return kind == PairKind::VertexTriangle ? closest_vertex_triangle(x) : closest_edge_edge(x);
}

}  // namespace piecework::collision
