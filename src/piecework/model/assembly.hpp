#pragma once

// The constant system matrix of projective dynamics.

#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::model {

/// K = diag(m / h^2) + sum_i w_i A_i^T A_i [Lu25, Eq. 3], |V| x |V|, N/m: one scalar matrix for the
/// three coordinates, symmetric positive definite, both triangles stored.
SparseMatrix assemble_system(const ClothModel& model, double h);

/// Numbering of the free vertices: fixed ones are eliminated, not penalised.
struct FreeVertices {
  std::vector<int> vertex;  ///< free number -> vertex, ascending
  std::vector<int> number;  ///< vertex -> free number, -1 if fixed

  FreeVertices() = default;
  explicit FreeVertices(const std::vector<char>& fixed);
  [[nodiscard]] int count() const { return static_cast<int>(vertex.size()); }
};

/// Rows and columns of the free vertices, K_ff.
SparseMatrix restrict_to_free(const SparseMatrix& K, const FreeVertices& free);

}  // namespace piecework::model
