#pragma once

// The constant system matrix of projective dynamics.

#include <span>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/topology.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::model {

/// K = diag(m / h^2) + sum_i w_i A_i^T A_i [Lu25, Eq. 3], |V| x |V|, N/m: one scalar matrix for the
/// three coordinates, symmetric positive definite, both triangles stored.
SparseMatrix assemble_system(const ClothModel& model, double h);

/// Which domain owns each constraint (views; decomposition::Decomposition has all of them).
struct ConstraintOwners {
  int num_domains = 0;
  std::span<const int> triangle_domain;  ///< per triangle
  std::span<const int> hinge_domain;     ///< per hinge of the model, bending or not
  /// Per vertex: the domains that own a constraint on it, ascending.
  const mesh::Adjacency& vertex_domains;
};

/// The domains' shares K^j of assemble_system() [Lu25, Eq. 4]: each constraint is assembled in the
/// one domain that owns it, and the mass of a vertex is divided evenly between its domains
/// (docs/architecture.md, D11). A vertex without constraints goes to domain 0. The shares sum to
/// assemble_system(model, h) up to rounding; K^j is N/m and may have no rows.
/// \throws InputError if the sizes do not match the model, an owner is out of range, or a
///         constraint's vertex does not list the owner among its domains.
std::vector<DomainMatrix> assemble_domain_systems(const ClothModel& model,
                                                  const ConstraintOwners& owners, double h);

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

/// The same for the domains' shares; `rows` become free numbers.
std::vector<DomainMatrix> restrict_to_free(std::span<const DomainMatrix> domains,
                                           const FreeVertices& free);

}  // namespace piecework::model
