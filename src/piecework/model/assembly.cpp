#include <piecework/model/assembly.hpp>

#include <utility>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::model {
namespace {

using Triplets = std::vector<Eigen::Triplet<double, int>>;

/// Adds w c c^T for a constraint that sees its vertices through one row c of A.
template <std::size_t N>
void add_row(const std::array<int, N>& vertices, const std::array<double, N>& c, double weight,
             Triplets& triplets) {
  for (std::size_t a = 0; a < N; ++a)
    for (std::size_t b = 0; b < N; ++b)
      triplets.emplace_back(vertices[a], vertices[b], weight * c[a] * c[b]);
}

void add_stretch(const StretchConstraint& c, const std::array<int, 3>& vertices,
                 Triplets& triplets) {
  for (int k = 0; k < 2; ++k) {  // column k of F = sum_a x_a g_a
    const double g1 = c.rest_inverse(0, k);
    const double g2 = c.rest_inverse(1, k);
    add_row<3>(vertices, {-(g1 + g2), g1, g2}, c.weight, triplets);
  }
}

/// The rows of every domain while its share is assembled.
class DomainAssembly {
 public:
  DomainAssembly(const ClothModel& model, const ConstraintOwners& owners)
      : domains_(static_cast<std::size_t>(owners.num_domains)), triplets_(domains_.size()) {
    const auto& [begin, item] = owners.vertex_domains;
    copies_.begin.assign(1, 0);
    for (int v = 0; v < model.num_vertices(); ++v) {
      const auto first = item.begin() + begin[static_cast<std::size_t>(v)];
      const auto last = item.begin() + begin[static_cast<std::size_t>(v) + 1];
      if (first == last) add_copy(v, 0);
      for (auto domain = first; domain != last; ++domain) add_copy(v, *domain);
      copies_.begin.push_back(static_cast<int>(copies_.item.size()));
    }
  }

  /// Local row of a vertex of a constraint that `domain` owns.
  [[nodiscard]] int local(int vertex, int domain) const {
    const auto v = static_cast<std::size_t>(vertex);
    for (int i = copies_.begin[v]; i < copies_.begin[v + 1]; ++i)
      if (copies_.item[static_cast<std::size_t>(i)] == domain)
        return local_[static_cast<std::size_t>(i)];
    throw InputError(fmt::format(
        "domains: vertex {} has a constraint of domain {}, which is not among its domains; "
        "take triangle, hinge and vertex domains from one decomposition",
        vertex, domain));
  }

  template <std::size_t N>
  [[nodiscard]] std::array<int, N> local(const std::array<int, N>& vertices, int domain) const {
    std::array<int, N> result{};
    for (std::size_t i = 0; i < N; ++i) result[i] = local(vertices[i], domain);
    return result;
  }

  [[nodiscard]] Triplets& triplets(int domain) {
    if (domain < 0 || domain >= static_cast<int>(domains_.size()))
      throw InputError(fmt::format("domains: owner {} of a constraint is not one of {} domains",
                                   domain, domains_.size()));
    return triplets_[static_cast<std::size_t>(domain)];
  }

  /// Adds a vertex's diagonal term, divided by the number of its domains.
  void add_mass(int vertex, double value) {
    const auto v = static_cast<std::size_t>(vertex);
    const double share = value / (copies_.begin[v + 1] - copies_.begin[v]);
    for (int i = copies_.begin[v]; i < copies_.begin[v + 1]; ++i) {
      const int row = local_[static_cast<std::size_t>(i)];
      triplets(copies_.item[static_cast<std::size_t>(i)]).emplace_back(row, row, share);
    }
  }

  std::vector<DomainMatrix> finish() {
    for (std::size_t d = 0; d < domains_.size(); ++d) {
      const auto size = static_cast<Eigen::Index>(domains_[d].rows.size());
      domains_[d].K.resize(size, size);
      domains_[d].K.setFromTriplets(triplets_[d].begin(), triplets_[d].end());
      Triplets().swap(triplets_[d]);
    }
    return std::move(domains_);
  }

 private:
  void add_copy(int vertex, int domain) {
    if (domain < 0 || domain >= static_cast<int>(domains_.size()))
      throw InputError(fmt::format("domains: vertex {} lists domain {}, which is not one of {}",
                                   vertex, domain, domains_.size()));
    std::vector<int>& rows = domains_[static_cast<std::size_t>(domain)].rows;
    copies_.item.push_back(domain);
    local_.push_back(static_cast<int>(rows.size()));
    rows.push_back(vertex);
  }

  std::vector<DomainMatrix> domains_;
  std::vector<Triplets> triplets_;
  mesh::Adjacency copies_;  ///< per vertex: its domains, domain 0 for a vertex without any
  std::vector<int> local_;  ///< per item of copies_: row in that domain
};

void check_sizes(const ClothModel& model, const ConstraintOwners& owners) {
  const auto check = [](const char* what, std::size_t have, std::size_t want) {
    if (have != want)
      throw InputError(
          fmt::format("domains: {} has {} entries, the model needs {}", what, have, want));
  };
  check("triangle_domain", owners.triangle_domain.size(), model.stretch.size());
  check("hinge_domain", owners.hinge_domain.size(), model.hinges.size());
  check("vertex_domains", owners.vertex_domains.begin.size(),
        static_cast<std::size_t>(model.num_vertices()) + 1);
}

}  // namespace

SparseMatrix assemble_system(const ClothModel& model, double h) {
  Triplets triplets;
  triplets.reserve(static_cast<std::size_t>(model.num_vertices()) + 18 * model.stretch.size() +
                   16 * model.bend.size());
  for (int v = 0; v < model.num_vertices(); ++v)
    triplets.emplace_back(v, v, model.mass[v] / (h * h));
  for (const StretchConstraint& c : model.stretch) add_stretch(c, c.vertices, triplets);
  for (const BendConstraint& c : model.bend)
    add_row<4>(c.vertices, c.coefficient, c.weight, triplets);
  SparseMatrix K(model.num_vertices(), model.num_vertices());
  K.setFromTriplets(triplets.begin(), triplets.end());
  return K;
}

std::vector<DomainMatrix> assemble_domain_systems(const ClothModel& model,
                                                  const ConstraintOwners& owners, double h) {
  check_sizes(model, owners);
  DomainAssembly assembly(model, owners);
  for (int v = 0; v < model.num_vertices(); ++v) assembly.add_mass(v, model.mass[v] / (h * h));
  for (std::size_t t = 0; t < model.stretch.size(); ++t) {
    const int domain = owners.triangle_domain[t];
    Triplets& triplets = assembly.triplets(domain);
    add_stretch(model.stretch[t], assembly.local(model.stretch[t].vertices, domain), triplets);
  }
  auto bend = model.bend.begin();
  for (std::size_t i = 0; i < model.hinges.size(); ++i) {
    if (!model.hinge_bends[i]) continue;
    const int domain = owners.hinge_domain[i];
    Triplets& triplets = assembly.triplets(domain);
    add_row<4>(assembly.local(bend->vertices, domain), bend->coefficient, bend->weight, triplets);
    ++bend;
  }
  return assembly.finish();
}

FreeVertices::FreeVertices(const std::vector<char>& fixed) : number(fixed.size(), -1) {
  for (std::size_t v = 0; v < fixed.size(); ++v) {
    if (fixed[v]) continue;
    number[v] = static_cast<int>(vertex.size());
    vertex.push_back(static_cast<int>(v));
  }
}

SparseMatrix restrict_to_free(const SparseMatrix& K, const FreeVertices& free) {
  Triplets triplets;
  triplets.reserve(static_cast<std::size_t>(K.nonZeros()));
  for (int column = 0; column < K.outerSize(); ++column) {
    const int free_column = free.number[static_cast<std::size_t>(column)];
    if (free_column < 0) continue;
    for (SparseMatrix::InnerIterator it(K, column); it; ++it) {
      const int free_row = free.number[static_cast<std::size_t>(it.row())];
      if (free_row >= 0) triplets.emplace_back(free_row, free_column, it.value());
    }
  }
  SparseMatrix result(free.count(), free.count());
  result.setFromTriplets(triplets.begin(), triplets.end());
  return result;
}

std::vector<DomainMatrix> restrict_to_free(std::span<const DomainMatrix> domains,
                                           const FreeVertices& free) {
  std::vector<DomainMatrix> result;
  result.reserve(domains.size());
  for (const DomainMatrix& domain : domains) {
    std::vector<char> fixed(domain.rows.size());
    std::vector<int> rows;
    for (std::size_t i = 0; i < fixed.size(); ++i) {
      const int number = free.number[static_cast<std::size_t>(domain.rows[i])];
      fixed[i] = number < 0;
      if (number >= 0) rows.push_back(number);
    }
    result.push_back({std::move(rows), restrict_to_free(domain.K, FreeVertices(fixed))});
  }
  return result;
}

}  // namespace piecework::model
