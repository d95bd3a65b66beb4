#pragma once

// The handful of types that every layer shares. SI units throughout.

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SparseCore>

namespace piecework {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat2 = Eigen::Matrix2d;
using Mat3 = Eigen::Matrix3d;
using Mat32 = Eigen::Matrix<double, 3, 2>;

/// |V| x 3, one row per vertex, row-major: x, y, z of a vertex are adjacent in memory.
using Positions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Symmetric system matrix, both triangles stored, column-major, 32-bit indices.
using SparseMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

/// One domain's share of a system matrix: the sum over the domains, each entry K(a, b) added at
/// (rows[a], rows[b]), is the matrix of the whole.
struct DomainMatrix {
  std::vector<int> rows;  ///< rows of the whole, ascending
  SparseMatrix K;         ///< rows.size() x rows.size(), symmetric, both triangles stored
};

/// Vertex indices of one triangle, counter-clockwise seen from the front.
using Triangle = std::array<int, 3>;
using Triangles = std::vector<Triangle>;

}  // namespace piecework
