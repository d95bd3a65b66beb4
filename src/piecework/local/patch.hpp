#pragma once

// Constraints in patches: pieces of cloth small enough that the positions and forces of one stay
// in the nearest caches while all its constraints are evaluated. Private to `local`.
//
// A patch numbers its vertices from 0; elements name them by 16 bits and add their forces into rows
// of the patch. So a triangle costs 38 bytes of memory traffic and a flat hinge 32, and only the
// rim of a patch (a tenth to a fifth of the vertices) goes through memory once more. A list of
// element forces that vertices gather costs 144 and 24 bytes on top, written and read again.

#include <cstdint>

namespace piecework::local {

/// Triangles in a batch, whatever the instruction set.
inline constexpr int kLanes = 8;

/// Where a vertex's row starts in a patch: four numbers times its number.
using RowOffset = std::uint16_t;

/// What is constant of eight triangles. The rest frame of each is turned so that Dm^-1 is upper
/// triangular, which changes neither energy nor forces. Missing triangles are zero.
struct alignas(64) TriangleBatch {
  double g00[kLanes], g01[kLanes], g11[kLanes];  ///< Dm^-1, 1/m
  double weight[kLanes];                         ///< w = k_s A, J
};

/// Their vertices.
struct BatchCorners {
  RowOffset corner[3][kLanes];
};

/// Quadratic bending of one hinge that is flat at rest, energy |sum_k c_k (x_k - x_0)|^2 / 2.
struct FlatHinge {
  double coefficient[3];  ///< sqrt(w) c of vertices 1 to 3; that of vertex 0 is minus their sum
  RowOffset vertex[4];
};

/// The same with rest length: energy (|sum_k c_k (x_k - x_0)| - length)^2 / 2.
struct CurvedHinge {
  FlatHinge hinge;
  double rest_length;  ///< times sqrt(w)
};

/// Ranges of one patch in the arrays of Patches.
struct Patch {
  int first_vertex = 0, num_vertices = 0;
  int num_inner = 0;  ///< the first so many vertices have constraints of this patch only
  int first_batch = 0, num_batches = 0;
  int first_flat = 0, num_flat = 0;
  int first_curved = 0, num_curved = 0;
  int first_partial = 0;  ///< row in which the sum for the first vertex on the rim is kept
};

}  // namespace piecework::local
