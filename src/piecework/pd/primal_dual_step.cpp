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

/// Seams between vertices that can move, numbered like them: what is held does not take part in an
/// increment, so x_s - sum_k T_sk x_k = 0 keeps its other terms.
mesh::SeamMap movable_seams(const mesh::SeamMap& seams, const model::FreeVertices& movable) {
  mesh::SeamMap result;
  result.row.assign(movable.vertex.size(), -1);
  result.begin.push_back(0);
  for (const int vertex : seams.slaves) {
    const int slave = movable.number[static_cast<std::size_t>(vertex)];
    if (slave < 0) continue;
    result.row[static_cast<std::size_t>(slave)] = result.num_slaves();
    result.slaves.push_back(slave);
    seams.visit_carriers(vertex, [&](int carrier, double weight) {
      const int number = movable.number[static_cast<std::size_t>(carrier)];
      if (number < 0) return;
      result.carrier.push_back(number);
      result.weight.push_back(weight);
    });
    result.begin.push_back(static_cast<int>(result.carrier.size()));
  }
  return result;
}

/// Per vertex: the domains that get a part of its mass. When slaves are eliminated, what carries a
/// slave appears in the slave's domains too, perhaps through that slave alone, and two carriers of
/// one slave make a singular K^j there; their own part of the mass keeps it definite (D11).
mesh::Adjacency sharing_domains(const model::ClothModel& model,
                                const decomposition::Decomposition& domains, SeamForm seams) {
  mesh::Adjacency own = owning_domains(model, domains);
  if (seams == SeamForm::Dual || model.sewing.empty()) return own;
  mesh::Adjacency result;
  result.begin.push_back(0);
  for (int v = 0; v < model.num_vertices(); ++v) {
    const mesh::Adjacency& from = model.sewing.map().is_slave(v) ? own : domains.vertex_domains;
    const auto i = static_cast<std::size_t>(v);
    result.item.insert(result.item.end(), from.item.begin() + from.begin[i],
                       from.item.begin() + from.begin[i + 1]);
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
        shares_(model::assemble_domain_systems(
            model,
            {domains.num_domains, domains.triangle_domain, domains.hinge_domain,
             sharing_domains(model, domains, options_.seams)},
            h)) {}

  global::SolveStatus factor(const SparseMatrix& K, std::span<const int> row_vertex) override {
    std::vector<char> fixed(static_cast<std::size_t>(model_.num_vertices()), 1);
    for (const int vertex : row_vertex) fixed[static_cast<std::size_t>(vertex)] = 0;
    has_slaves_ = options_.seams == SeamForm::Dual && !model_.sewing.empty();
    const global::SolveStatus status =
        has_slaves_ ? factor_with_slaves(std::move(fixed), row_vertex)
                    : factor_domains(model::Reduction(model_, fixed).systems(shares_),
                                     static_cast<int>(K.rows()), {});
    const global::PrimalDualReport& primal_dual = solver_.report();
    report_ = {};
    report_.analyze_ms = primal_dual.analyze_ms;
    report_.factor_ms = primal_dual.factor_ms - primal_dual.analyze_ms;
    report_.nonzeros = primal_dual.domain_nonzeros + primal_dual.interface_nonzeros;
    report_.bytes = primal_dual.domain_bytes + primal_dual.interface_bytes;
    return status;
  }

  global::SolveStatus solve(global::RightHandSides& b) override {
    return has_slaves_ ? solve_with_slaves(b) : solver_.solve(b);
  }
  [[nodiscard]] const global::FactorReport& report() const override { return report_; }
  [[nodiscard]] std::string description() const override {
    const global::PrimalDualReport& report = solver_.report();
    return fmt::format(
        "primal-dual, {} domains, {} multipliers{}, {} corners", report.num_domains,
        report.num_multipliers,
        has_slaves_ ? fmt::format(" ({} of seams)", report.num_seam_multipliers) : "",
        report.num_corners);
  }

 private:
  global::SolveStatus factor_domains(const std::vector<DomainMatrix>& domains, int num_rows,
                                     mesh::SeamMap seams) {
    return solver_.factor(
        domains,
        global::classify_dofs(domains, num_rows, {.corner_fraction = options_.corner_fraction},
                              std::move(seams)),
        options_.solver);
  }

  /// \param fixed  per vertex: 0 for the unknowns, 1 for slaves and held vertices
  global::SolveStatus factor_with_slaves(std::vector<char> fixed, std::span<const int> row_vertex) {
    const mesh::SeamMap& seams = model_.sewing.map();
    for (const int slave : seams.slaves) {
      char held = 1;
      seams.visit_carriers(slave, [&](int carrier, double) {
        held = held && fixed[static_cast<std::size_t>(carrier)];
      });
      fixed[static_cast<std::size_t>(slave)] = held;
    }
    const model::FreeVertices movable(fixed);
    unknown_row_.clear();
    for (const int vertex : row_vertex)
      unknown_row_.push_back(movable.number[static_cast<std::size_t>(vertex)]);
    with_slaves_.resize(movable.count(), 3);
    return factor_domains(model::restrict_to_free(shares_, movable), movable.count(),
                          movable_seams(seams, movable));
  }

  /// b = T_f^T f is the same for every f with that sum: all of it on the unknowns, none on slaves.
  global::SolveStatus solve_with_slaves(global::RightHandSides& b) {
    with_slaves_.setZero();
    for (std::size_t i = 0; i < unknown_row_.size(); ++i)
      with_slaves_.row(unknown_row_[i]) = b.row(static_cast<Eigen::Index>(i));
    const global::SolveStatus status = solver_.solve(with_slaves_);
    if (status != global::SolveStatus::Ok) return status;
    for (std::size_t i = 0; i < unknown_row_.size(); ++i)
      b.row(static_cast<Eigen::Index>(i)) = with_slaves_.row(unknown_row_[i]);
    return status;
  }

  const model::ClothModel& model_;
  PrimalDualStepOptions options_;
  std::vector<DomainMatrix> shares_;  ///< on all vertices
  bool has_slaves_ = false;           ///< SeamForm::Dual, and something is sewn
  std::vector<int> unknown_row_;      ///< per unknown: its row among unknowns and slaves
  global::RightHandSides with_slaves_;
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
