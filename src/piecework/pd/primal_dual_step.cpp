#include <piecework/pd/primal_dual_step.hpp>

#include <fmt/format.h>

#include <piecework/model/assembly.hpp>
#include <piecework/model/reduction.hpp>

namespace piecework::pd {
namespace {

/// Per vertex: the domains that own a constraint on it, before anything is sewn.
mesh::Adjacency owning_domains(const model::ClothModel& model,
                               const decomposition::Decomposition& domains) {
  return decomposition::constraint_domains(
      {model.triangles, model.hinges, model.hinge_bends, model.num_vertices()}, domains);
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
    const std::vector<DomainMatrix> domains = reduction.systems(shares_);
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
