#pragma once

// Cloths divided into domains, for the tests of this folder.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <piecework/core/random.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/global/cholmod_solver.hpp>
#include <piecework/global/domain_matrices.hpp>
#include <piecework/global/interface_dofs.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::global {

inline constexpr double kStep = 1.0 / 120.0;  // s

/// An open tube: the columns of a sheet closed to a circle.
inline mesh::TriangleMesh tube_mesh(int around, int along) {
  mesh::TriangleMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(around) * along, 3);
  for (int j = 0; j < along; ++j)
    for (int i = 0; i < around; ++i) {
      const double angle = 2 * std::numbers::pi * i / around;
      mesh.positions.row(j * around + i) << 0.2 * std::cos(angle), 1.0 * j / (along - 1),
          0.2 * std::sin(angle);
    }
  for (int j = 0; j + 1 < along; ++j)
    for (int i = 0; i < around; ++i) {
      const int a = j * around + i;
      const int b = j * around + (i + 1) % around;
      mesh.triangles.push_back({a, a + around, b});
      mesh.triangles.push_back({b, a + around, b + around});
    }
  return mesh;
}

/// A cloth with an owner for every constraint.
struct DecomposedCloth {
  model::ClothModel model;
  int num_domains = 0;
  std::vector<int> triangle_domain;
  std::vector<int> hinge_domain;
  mesh::Adjacency vertex_domains;

  [[nodiscard]] RowDomains row_domains() const {
    return {vertex_domains.begin, vertex_domains.item};
  }
  [[nodiscard]] std::vector<DomainMatrix> matrices(double h = kStep) const {
    return model::assemble_domain_systems(
        model, {num_domains, triangle_domain, hinge_domain, vertex_domains}, h);
  }
  [[nodiscard]] SparseMatrix K(double h = kStep) const { return model::assemble_system(model, h); }
};

inline DecomposedCloth decompose_cloth(model::ClothModel model, int domains) {
  DecomposedCloth cloth;
  auto decomposition = decomposition::decompose(
      {model.triangles, model.hinges, model.hinge_bends, model.num_vertices()},
      {.domains = domains});
  cloth.model = std::move(model);
  cloth.num_domains = decomposition.num_domains;
  cloth.triangle_domain = std::move(decomposition.triangle_domain);
  cloth.hinge_domain = std::move(decomposition.hinge_domain);
  cloth.vertex_domains = std::move(decomposition.vertex_domains);
  return cloth;
}

/// Any triangles in any domains; hinges go to the lower one.
inline DecomposedCloth assign_triangles(model::ClothModel model, std::vector<int> triangle_domain,
                                        int domains) {
  DecomposedCloth cloth;
  std::vector<std::vector<int>> lists(static_cast<std::size_t>(model.num_vertices()));
  for (std::size_t t = 0; t < model.triangles.size(); ++t)
    for (const int v : model.triangles[t])
      lists[static_cast<std::size_t>(v)].push_back(triangle_domain[t]);
  for (std::size_t i = 0; i < model.hinges.size(); ++i) {
    const auto& [t0, t1] = model.hinges[i].triangles;
    cloth.hinge_domain.push_back(std::min(triangle_domain[static_cast<std::size_t>(t0)],
                                          triangle_domain[static_cast<std::size_t>(t1)]));
    if (!model.hinge_bends[i]) continue;
    for (const int v : model.hinges[i].vertices)
      lists[static_cast<std::size_t>(v)].push_back(cloth.hinge_domain.back());
  }
  cloth.vertex_domains.begin.push_back(0);
  for (auto& list : lists) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    auto& item = cloth.vertex_domains.item;
    item.insert(item.end(), list.begin(), list.end());
    cloth.vertex_domains.begin.push_back(static_cast<int>(item.size()));
  }
  cloth.model = std::move(model);
  cloth.triangle_domain = std::move(triangle_domain);
  cloth.num_domains = domains;
  return cloth;
}

inline model::ClothModel grid_cloth(int columns, int rows,
                                    std::optional<double> bending = 7.014e-6) {
  return testing::cloth_model(testing::grid_mesh(columns, rows), testing::cotton(bending));
}

/// Slabs of a grid: domain boundaries that run from border to border, so no corners.
inline DecomposedCloth slab_cloth(int columns, int rows, int domains,
                                  std::optional<double> bending = 7.014e-6) {
  std::vector<int> triangle_domain;
  const int per_row = 2 * (columns - 1);
  for (int t = 0; t < per_row * (rows - 1); ++t)
    triangle_domain.push_back(t / per_row * domains / (rows - 1));
  return assign_triangles(grid_cloth(columns, rows, bending), triangle_domain, domains);
}

/// Random owners of triangles: nearly everything is a corner.
inline DecomposedCloth random_cloth(int side, int domains, std::uint64_t seed) {
  Random random(seed);
  model::ClothModel model = grid_cloth(side, side);
  std::vector<int> triangle_domain(model.triangles.size());
  for (int& domain : triangle_domain)
    domain = static_cast<int>(random.next() % static_cast<std::uint64_t>(domains));
  return assign_triangles(std::move(model), std::move(triangle_domain), domains);
}

/// K of a cloth with integers for entries and, without `diagonal`, with constants as its null
/// space: sums of its entries have no rounding, so it is singular to the last bit.
inline SparseMatrix integer_matrix(const DecomposedCloth& cloth, double diagonal) {
  SparseMatrix K = cloth.K();
  for (int column = 0; column < K.outerSize(); ++column) {
    double sum = diagonal;
    for (SparseMatrix::InnerIterator it(K, column); it; ++it) {
      if (it.row() == column) continue;
      it.valueRef() = -1.0 - static_cast<double>((it.row() + column) % 7);
      sum -= it.value();
    }
    K.coeffRef(column, column) = sum;
  }
  return K;
}

/// Largest difference relative to the largest entry of `expected`.
inline double relative_error(const RightHandSides& x, const RightHandSides& expected) {
  return (x - expected).lpNorm<Eigen::Infinity>() / expected.lpNorm<Eigen::Infinity>();
}

/// The oracle: K undivided; its own rounding is removed by two steps of refinement with residuals
/// in extended precision.
inline RightHandSides undivided_solve(const SparseMatrix& K, const RightHandSides& b) {
  CholmodSolver solver;
  RightHandSides x = b;
  if (solver.factor(K) != SolveStatus::Ok || solver.solve(x) != SolveStatus::Ok)
    return RightHandSides::Constant(b.rows(), 3, std::nan(""));
  for (int step = 0; step < 2; ++step) {
    Eigen::Matrix<long double, Eigen::Dynamic, 3> r = b.cast<long double>();
    for (int column = 0; column < K.outerSize(); ++column)
      for (SparseMatrix::InnerIterator it(K, column); it; ++it)
        r.row(it.row()) -= static_cast<long double>(it.value()) * x.row(column).cast<long double>();
    RightHandSides correction = r.cast<double>();
    if (solver.solve(correction) != SolveStatus::Ok) break;
    x += correction;
  }
  return x;
}

}  // namespace piecework::global
