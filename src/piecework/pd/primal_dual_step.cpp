#include <piecework/pd/primal_dual_step.hpp>

#include <algorithm>

#include <fmt/format.h>

#include <piecework/model/assembly.hpp>
#include <piecework/model/reduction.hpp>

namespace piecework::pd {
namespace {

/// T_f^T K^j T_f on the unknowns that it couples.
DomainMatrix reduce(const DomainMatrix& share, const model::Reduction& reduction,
                    int num_vertices) {
  std::vector<Eigen::Triplet<double, int>> entries;
  entries.reserve(static_cast<std::size_t>(share.K.nonZeros()));
  for (int c = 0; c < share.K.outerSize(); ++c)
    for (SparseMatrix::InnerIterator it(share.K, c); it; ++it)
      entries.emplace_back(share.rows[static_cast<std::size_t>(it.row())],
                           share.rows[static_cast<std::size_t>(c)], it.value());
  SparseMatrix whole(num_vertices, num_vertices);
  whole.setFromTriplets(entries.begin(), entries.end());
  const SparseMatrix reduced = reduction.system(whole);

  DomainMatrix result;
  std::vector<int> local(static_cast<std::size_t>(reduced.cols()), -1);
  for (int c = 0; c < reduced.outerSize(); ++c) {
    if (reduced.outerIndexPtr()[c] == reduced.outerIndexPtr()[c + 1]) continue;
    local[static_cast<std::size_t>(c)] = static_cast<int>(result.rows.size());
    result.rows.push_back(c);
  }
  entries.clear();
  for (const int c : result.rows)
    for (SparseMatrix::InnerIterator it(reduced, c); it; ++it)
      entries.emplace_back(local[static_cast<std::size_t>(it.row())],
                           local[static_cast<std::size_t>(c)], it.value());
  const auto size = static_cast<Eigen::Index>(result.rows.size());
  result.K.resize(size, size);
  result.K.setFromTriplets(entries.begin(), entries.end());
  return result;
}

/// Per vertex: the domains that own a constraint on it, before anything is sewn or held.
mesh::Adjacency owning_domains(const model::ClothModel& model,
                               const decomposition::Decomposition& domains) {
  std::vector<std::vector<int>> lists(static_cast<std::size_t>(model.num_vertices()));
  for (std::size_t t = 0; t < model.triangles.size(); ++t)
    for (const int v : model.triangles[t])
      lists[static_cast<std::size_t>(v)].push_back(domains.triangle_domain[t]);
  for (std::size_t h = 0; h < model.hinges.size(); ++h)
    if (model.hinge_bends[h])
      for (const int v : model.hinges[h].vertices)
        lists[static_cast<std::size_t>(v)].push_back(domains.hinge_domain[h]);
  mesh::Adjacency result;
  result.begin.push_back(0);
  for (auto& list : lists) {
    std::sort(list.begin(), list.end());
    result.item.insert(result.item.end(), list.begin(), std::unique(list.begin(), list.end()));
    result.begin.push_back(static_cast<int>(result.item.size()));
  }
  return result;
}

class PrimalDualStep final : public global::ExactSolver {
 public:
  PrimalDualStep(const model::ClothModel& model, const decomposition::Decomposition& domains,
                 double h, PrimalDualStepOptions options)
      : model_(model),
        options_(std::move(options)),
        shares_(
            model::assemble_domain_systems(model,
                                           {domains.num_domains, domains.triangle_domain,
                                            domains.hinge_domain, owning_domains(model, domains)},
                                           h)) {}

  global::SolveStatus factor(const SparseMatrix& K, std::span<const int> row_vertex) override {
    std::vector<char> fixed(static_cast<std::size_t>(model_.num_vertices()), 1);
    for (const int vertex : row_vertex) fixed[static_cast<std::size_t>(vertex)] = 0;
    const model::Reduction reduction(model_, fixed);
    std::vector<DomainMatrix> domains;
    for (const DomainMatrix& share : shares_)
      domains.push_back(reduce(share, reduction, model_.num_vertices()));
    global::InterfaceDofs dofs = global::classify_dofs(
        domains, static_cast<int>(K.rows()), {.corner_fraction = options_.corner_fraction});
    const global::SolveStatus status = solver_.factor(domains, std::move(dofs), options_.solver);
    const global::PrimalDualReport& primal_dual = solver_.report();
    report_ = {};
    report_.analyze_ms = primal_dual.analyze_ms;
    report_.factor_ms = primal_dual.factor_ms - primal_dual.analyze_ms;
    report_.nonzeros = primal_dual.domain_nonzeros + primal_dual.interface_nonzeros;
    report_.bytes = primal_dual.domain_bytes + primal_dual.interface_bytes;
    return status;
  }

  global::SolveStatus solve(global::RightHandSides& b) override { return solver_.solve(b); }
  [[nodiscard]] const global::FactorReport& report() const override { return report_; }
  [[nodiscard]] std::string description() const override {
    return fmt::format("primal-dual, {} domains, {} multipliers, {} corners",
                       solver_.report().num_domains, solver_.report().num_multipliers,
                       solver_.report().num_corners);
  }

 private:
  const model::ClothModel& model_;
  PrimalDualStepOptions options_;
  std::vector<DomainMatrix> shares_;  ///< on all vertices
  global::PrimalDual solver_;
  global::FactorReport report_;
};

}  // namespace

std::unique_ptr<global::ExactSolver> make_primal_dual_solver(
    const model::ClothModel& model, const decomposition::Decomposition& domains, double h,
    const PrimalDualStepOptions& options) {
  return std::make_unique<PrimalDualStep>(model, domains, h, options);
}

}  // namespace piecework::pd
