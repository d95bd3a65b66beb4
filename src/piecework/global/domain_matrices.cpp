#include <piecework/global/domain_matrices.hpp>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::global {
namespace {

using Triplets = std::vector<Eigen::Triplet<double, int>>;

/// A row's place in one domain.
struct Copy {
  int domain;
  int local;
};

/// Per row its copies; rows of no domain get one in domain 0.
struct Copies {
  std::vector<std::size_t> begin{0};
  std::vector<Copy> item;

  [[nodiscard]] std::span<const Copy> of(int row) const {
    const auto r = static_cast<std::size_t>(row);
    return std::span(item).subspan(begin[r], begin[r + 1] - begin[r]);
  }
};

Copies number_copies(const RowDomains& row_domains, std::vector<DomainMatrix>& domains) {
  Copies copies;
  const auto add = [&](int row, int domain) {
    if (domain < 0 || domain >= static_cast<int>(domains.size()))
      throw InputError(fmt::format("domains: row {} lists domain {}, which is not one of {}", row,
                                   domain, domains.size()));
    std::vector<int>& rows = domains[static_cast<std::size_t>(domain)].rows;
    copies.item.push_back({domain, static_cast<int>(rows.size())});
    rows.push_back(row);
  };
  for (std::size_t row = 0; row + 1 < row_domains.begin.size(); ++row) {
    const int first = row_domains.begin[row];
    const int last = row_domains.begin[row + 1];
    if (first == last) add(static_cast<int>(row), 0);
    for (int i = first; i < last; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (i > first && row_domains.item[k - 1] >= row_domains.item[k])
        throw InputError(fmt::format("domains: row {} does not list its domains ascending", row));
      add(static_cast<int>(row), row_domains.item[k]);
    }
    copies.begin.push_back(copies.item.size());
  }
  return copies;
}

/// Calls visit(domain, local a, local b) for each domain with both rows, ascending.
template <class Visit>
void for_shared_domains(std::span<const Copy> a, std::span<const Copy> b, const Visit& visit) {
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i].domain == b[j].domain) {
      visit(a[i].domain, a[i].local, b[j].local);
      ++i;
      ++j;
    } else if (a[i].domain < b[j].domain) {
      ++i;
    } else {
      ++j;
    }
  }
}

}  // namespace

std::vector<DomainMatrix> split_matrix(const SparseMatrix& K, const RowDomains& row_domains,
                                       int num_domains) {
  if (num_domains < 0 || K.rows() != K.cols() ||
      row_domains.begin.size() != static_cast<std::size_t>(K.rows()) + 1 ||
      row_domains.begin.back() != static_cast<int>(row_domains.item.size()))
    throw InputError(
        fmt::format("domains: {} domains for a matrix of {} x {} and lists of {} rows; give each "
                    "row of a square matrix its list",
                    num_domains, K.rows(), K.cols(),
                    static_cast<std::ptrdiff_t>(row_domains.begin.size()) - 1));
  std::vector<DomainMatrix> domains(static_cast<std::size_t>(num_domains));
  const Copies copies = number_copies(row_domains, domains);
  std::vector<Triplets> triplets(domains.size());
  for (int column = 0; column < K.outerSize(); ++column)
    for (SparseMatrix::InnerIterator it(K, column); it; ++it) {
      const auto a = copies.of(static_cast<int>(it.row()));
      const auto b = copies.of(column);
      int shared = 0;
      for_shared_domains(a, b, [&](int, int, int) { ++shared; });
      if (shared == 0)
        throw InputError(
            fmt::format("domains: entry ({}, {}) of the matrix has no domain with both rows; add "
                        "one of the rows to a domain of the other",
                        it.row(), column));
      for_shared_domains(a, b, [&](int domain, int i, int j) {
        triplets[static_cast<std::size_t>(domain)].emplace_back(i, j, it.value() / shared);
      });
    }
  for (std::size_t d = 0; d < domains.size(); ++d) {
    const auto size = static_cast<Eigen::Index>(domains[d].rows.size());
    domains[d].K.resize(size, size);
    domains[d].K.setFromTriplets(triplets[d].begin(), triplets[d].end());
  }
  return domains;
}

SparseMatrix sum_matrices(std::span<const DomainMatrix> domains, int num_rows) {
  Triplets triplets;
  for (const DomainMatrix& domain : domains)
    for (int column = 0; column < domain.K.outerSize(); ++column)
      for (SparseMatrix::InnerIterator it(domain.K, column); it; ++it)
        triplets.emplace_back(domain.rows[static_cast<std::size_t>(it.row())],
                              domain.rows[static_cast<std::size_t>(column)], it.value());
  SparseMatrix K(num_rows, num_rows);
  K.setFromTriplets(triplets.begin(), triplets.end());
  return K;
}

SparseMatrix fold_matrix(const SparseMatrix& K, const mesh::SeamMap& seams) {
  Triplets triplets;
  for (int row = 0; row < K.rows(); ++row)
    seams.visit_carriers(
        row, [&](int carrier, double weight) { triplets.emplace_back(row, carrier, weight); });
  SparseMatrix T(K.rows(), K.cols());
  T.setFromTriplets(triplets.begin(), triplets.end());
  const SparseMatrix KT = K * T;
  return T.transpose() * KT;
}

}  // namespace piecework::global
