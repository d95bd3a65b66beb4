#pragma once

// A system matrix as a sum over domains, by algebra alone.

#include <span>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/seams.hpp>

namespace piecework::global {

/// Which domains a row belongs to (a view): those of row r are
/// item[begin[r]] ... item[begin[r + 1] - 1], ascending.
struct RowDomains {
  std::span<const int> begin;  ///< one more than there are rows
  std::span<const int> item;
};

/// Divides any symmetric K, n x n, among domains: an entry (i, j) goes in equal parts to the
/// domains that have both rows. A row of no domain goes to domain 0. The shares sum to K up to
/// rounding.
///
/// Unlike shares made of constraints (model::assemble_domain_systems) these need not be positive
/// definite, even if K is: a row's off-diagonal entries may weigh more in one domain than its part
/// of the diagonal. PrimalDual::factor() then answers NotPositiveDefinite.
/// \throws InputError if an entry (i, j) of the pattern has no domain with both rows, a domain is
///         out of range or a list is not ascending, or sizes do not match.
std::vector<DomainMatrix> split_matrix(const SparseMatrix& K, const RowDomains& row_domains,
                                       int num_domains);

/// The sum of the shares, num_rows x num_rows. \pre rows lie in [0, num_rows).
SparseMatrix sum_matrices(std::span<const DomainMatrix> domains, int num_rows);

/// T^T K T, n x n, with empty rows and columns for slaves; the seams are of the rows of K.
SparseMatrix fold_matrix(const SparseMatrix& K, const mesh::SeamMap& seams);

}  // namespace piecework::global
