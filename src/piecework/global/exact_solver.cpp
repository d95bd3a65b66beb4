#include <piecework/global/exact_solver.hpp>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/global/eigen_views.hpp>

namespace piecework::global {
namespace {

class TreeExactSolver final : public ExactSolver {
 public:
  TreeExactSolver(VertexTree domains, const TreeOptions& options)
      : domains_(std::move(domains)), tree_(options) {}

  SolveStatus factor(const SparseMatrix& K, std::span<const int> row_vertex) override {
    std::vector<int> row_node;
    if (!domains_.vertex_node.empty())
      for (const int vertex : row_vertex)
        row_node.push_back(domains_.vertex_node[static_cast<std::size_t>(vertex)]);
    const DomainTree domains{domains_.node_parent, row_node};
    tree_.analyze(pattern_of(K), row_node.empty() ? nullptr : &domains);
    return tree_.factor(values_of(K));
  }

  SolveStatus solve(RightHandSides& b) override {
    return tree_.solve(b.data(), b.data(), 3, 1, b.rows());
  }

  [[nodiscard]] const FactorReport& report() const override { return tree_.report(); }
  [[nodiscard]] TreeSolver* tree() override { return &tree_; }
  [[nodiscard]] std::string description() const override {
    const std::string& why = tree_.report().fallback;
    return why.empty() ? tree_.description() : tree_.description() + " because " + why;
  }

 private:
  VertexTree domains_;
  TreeSolver tree_;
};

}  // namespace

void require_factor(SolveStatus status, int unknowns) {
  if (status == SolveStatus::OutOfMemory)
    throw SimulationError(
        fmt::format("the factor of {} unknowns does not fit into memory", unknowns));
  if (status != SolveStatus::Ok)
    throw SimulationError(
        "the system matrix is not positive definite; stiffness, density or h are "
        "too extreme for double precision: bring them closer together");
}

std::unique_ptr<ExactSolver> make_tree_solver(VertexTree domains, const TreeOptions& options) {
  return std::make_unique<TreeExactSolver>(std::move(domains), options);
}

}  // namespace piecework::global
