#pragma once

// What is done with all constraints of a patch, compiled once per instruction set and chosen at run
// time. Private to `local`.
//
// Positions and forces of a patch are rows of four numbers: x, y, z, 0.

#include <piecework/core/isa.hpp>

#include "patch.hpp"

namespace piecework::local {

/// Inner vertices of a patch and what their sums need.
struct InnerVertices {
  const int* vertex;
  int count;
  const double* inertia;    ///< m / h^2, N/m, one per vertex of `vertex`
  const double* predicted;  ///< z, |V| x 3, m
  const char* fixed;        ///< |V|
};

/// Lanes that the closed form cannot do.
struct Degenerate {
  int* slot;  ///< kLanes * batch + lane, room for all
  int count;
};

struct PatchKernels {
  /// rows[i] = x[vertex[i]]; x is |V| x 3.
  void (*gather)(const double* x, const int* vertex, int count, double* rows);
  /// Adds w (F - R) G^T to the rows of `force` and returns the sum of w/2 |F - R|^2, J. Degenerate
  /// triangles, and lanes without one, are listed instead and add nothing.
  double (*triangles)(const TriangleBatch* batches, const BatchCorners* corners, int count,
                      const double* x, double* force, Degenerate& degenerate);
  /// The same for hinges: adds w c (c^T x - y).
  double (*flat)(const FlatHinge* hinges, int count, const double* x, double* force);
  double (*curved)(const CurvedHinge* hinges, int count, const double* x, double* force);
  /// gradient = force + m / h^2 (x - z) of inner vertices, zero if fixed; |V| x 3. Returns the
  /// inertial energy, J.
  double (*finish)(const InnerVertices& vertices, const double* x, const double* force,
                   double* gradient);
};

/// \pre this processor runs `isa`.
const PatchKernels& patch_kernels(Isa isa);

const PatchKernels& portable_patch_kernels();
const PatchKernels& avx2_patch_kernels();
const PatchKernels& avx512_patch_kernels();

}  // namespace piecework::local
