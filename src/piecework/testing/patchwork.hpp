#pragma once

// Rectangular patches side by side whose borders do not conform, and the stitches between them
// found by geometry alone.

#include <vector>

#include <piecework/mesh/seams.hpp>
#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::testing {

/// columns x rows vertices over [x0, x1] x [z0, z1], m.
struct Patch {
  double x0, z0, x1, z1;
  int columns, rows;
};

/// All patches in one mesh, not connected, vertices patch after patch.
mesh::TriangleMesh patchwork(const std::vector<Patch>& patches);

/// A unit square of four patches of 13 x 7, 6 x 6, 9 x 8 and 5 x 12 vertices that meet in two
/// T-junctions, both inside an edge.
std::vector<Patch> four_patches();

/// Every vertex that lies on a border edge of an earlier patch, sewn onto the first such edge (or
/// vertex). By brute force, and without contradictions by construction.
std::vector<mesh::Stitch> geometric_stitches(const std::vector<Patch>& patches);

/// Rows e_v - (1 - r) e_a - r e_b, one per stitch: C x = 0 says what stitches say.
Eigen::MatrixXd constraint_rows(const std::vector<mesh::Stitch>& stitches, int num_vertices);

/// Rows e_s - sum_k T_sk e_k, one per slave: the same of resolved seams.
Eigen::MatrixXd constraint_rows(const mesh::SeamMap& seams);

/// argmin x^T K x / 2 - b^T x under C x = 0, by one dense solve with multipliers: shares nothing
/// with the elimination or with domains.
/// \pre the rows of C are independent.
Eigen::MatrixXd solve_with_multipliers(const Eigen::MatrixXd& K, const Eigen::MatrixXd& b,
                                       const Eigen::MatrixXd& C);

/// For messages in tests: "seam 0", "vertex 7".
mesh::SeamNames plain_names();

}  // namespace piecework::testing
