#include "spread.hpp"

#include <piecework/global/eigen_views.hpp>
#include <piecework/global/exact_solver.hpp>

namespace piecework::untangle {
namespace {

constexpr double kStrength = 10;  ///< of a push against one edge

SparseMatrix laplacian(const Setting& setting) {
  const int count = setting.model.num_vertices();
  std::vector<Eigen::Triplet<double, int>> entries;
  for (int v = 0; v < count; ++v) entries.emplace_back(v, v, 0);  // in the pattern
  for (const auto& [v, w] : setting.surface.edges) {
    if (!setting.surface.is_cloth(v)) continue;
    entries.emplace_back(v, v, 1);
    entries.emplace_back(w, w, 1);
    entries.emplace_back(v, w, -1);
    entries.emplace_back(w, v, -1);
  }
  SparseMatrix L(count, count);
  L.setFromTriplets(entries.begin(), entries.end());
  return L;
}

}  // namespace

Spread::Spread(const Setting& setting)
    : setting_(setting), reduction_(setting.model, setting.held), laplacian_(laplacian(setting)) {}

void Spread::move(const Displacements& wanted, double reach, Positions& x) {
  SparseMatrix A = laplacian_;
  Positions rhs = Positions::Zero(x.rows(), 3);
  for (int v = 0; v < setting_.model.num_vertices(); ++v) {
    A.coeffRef(v, v) += 1 / (reach * reach);
    if (!wanted.pushed[static_cast<std::size_t>(v)]) continue;
    A.coeffRef(v, v) += kStrength;
    rhs.row(v) = kStrength * wanted.u.row(v);
  }
  const SparseMatrix reduced = reduction_.system(A);
  if (!analyzed_) solver_.analyze(global::pattern_of(reduced));
  analyzed_ = true;
  Positions u;
  reduction_.gather(rhs, u);
  global::require_factor(solver_.factor(global::values_of(reduced)), reduction_.count());
  global::require_factor(solver_.solve(u.data(), u.data(), 3, 3, 1), reduction_.count());
  Positions moved(x.rows(), 3);
  reduction_.advance(x, 1.0, u, moved);
  x.swap(moved);
}

}  // namespace piecework::untangle
