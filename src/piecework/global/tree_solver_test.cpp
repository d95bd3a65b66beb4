#include <piecework/global/tree_solver.hpp>

#include <cmath>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/random.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/global/cholmod_solver.hpp>
#include <piecework/global/eigen_views.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::global {
namespace {

constexpr double kH = 1.0 / 120.0;

struct Cloth {
  model::ClothModel model;
  SparseMatrix K;

  explicit Cloth(const mesh::TriangleMesh& mesh, const model::Material& material = {0.5, 2e4, 2e-2},
                 double h = kH)
      : model(testing::cloth_model(mesh, material)), K(model::assemble_system(model, h)) {}
  explicit Cloth(int side) : Cloth(testing::grid_mesh(side, side)) {}
};

/// The borders of a decomposition as a tree for the solver.
struct Borders {
  std::vector<int> parent, row_node;
  Borders(const Cloth& cloth, int domains) {
    const auto parts =
        decomposition::decompose({cloth.model.triangles, cloth.model.hinges,
                                  cloth.model.hinge_bends, cloth.model.num_vertices()},
                                 {.domains = domains});
    for (const auto& node : parts.nodes) parent.push_back(node.parent);
    row_node = parts.vertex_node;
  }
  [[nodiscard]] DomainTree tree() const { return {parent, row_node}; }
};

Positions solve(TreeSolver& solver, const Positions& b) {
  Positions x(b.rows(), 3);
  EXPECT_EQ(solver.solve(b.data(), x.data(), 3, 3, 1), SolveStatus::Ok);
  return x;
}

TreeSolver factored(const SparseMatrix& K, const TreeOptions& options = {},
                    const DomainTree* domains = nullptr) {
  TreeSolver solver(options);
  solver.analyze(pattern_of(K), domains);
  EXPECT_EQ(solver.factor(values_of(K)), SolveStatus::Ok);
  return solver;
}

/// Largest |b - K x| against |K| |x| + |b|, in the maximum norm over each column.
double backward_error(const SparseMatrix& K, const Positions& x, const Positions& b) {
  const SparseMatrix magnitude = K.cwiseAbs();
  const double norm = (magnitude * Eigen::VectorXd::Ones(K.cols())).maxCoeff();
  double worst = 0;
  for (int c = 0; c < 3; ++c) {
    const Eigen::VectorXd residual = b.col(c) - K * x.col(c);
    worst =
        std::max(worst, residual.cwiseAbs().maxCoeff() / (norm * x.col(c).cwiseAbs().maxCoeff() +
                                                          b.col(c).cwiseAbs().maxCoeff()));
  }
  return worst;
}

double energy_norm(const SparseMatrix& K, const Positions& e) {
  return std::sqrt((e.transpose() * (K * e)).trace());
}

class EveryIsa : public ::testing::TestWithParam<Isa> {};

TEST_P(EveryIsa, AgreesWithAnUndividedFactor) {
  const Cloth cloth(60);
  const Positions b = testing::random_positions(3600, 1, 2);
  RightHandSides expected = b;
  CholmodSolver oracle;
  ASSERT_EQ(oracle.factor(cloth.K), SolveStatus::Ok);
  ASSERT_EQ(oracle.solve(expected), SolveStatus::Ok);
  TreeSolver solver = factored(cloth.K, {.isa = GetParam()});
  EXPECT_LT((solve(solver, b) - expected).norm() / expected.norm(), 1e-11);
  EXPECT_LT(backward_error(cloth.K, solve(solver, b), b), 1e-13);
  EXPECT_NEAR(solver.report().nonzeros, oracle.report().nonzeros, 0.02 * solver.report().nonzeros);
}

TEST_P(EveryIsa, SinglePrecisionIsAContraction) {
  const Cloth cloth(60);
  const Positions x = testing::random_positions(3600, 1, 3);
  const Positions b = cloth.K * x;
  TreeSolver solver = factored(cloth.K, {.precision = Precision::Single, .isa = GetParam()});
  ASSERT_EQ(solver.report().precision, Precision::Single) << solver.report().fallback;
  Positions found = solve(solver, b);
  const double once = energy_norm(cloth.K, x - found) / energy_norm(cloth.K, x);
  EXPECT_LT(once, 1e-4);
  EXPECT_GT(once, 1e-9) << "that would be 64 bits";
  EXPECT_LT(solver.report().contraction, 1e-3);
  EXPECT_GT(solver.report().contraction, 0.1 * once);
  for (int k = 0; k < 3; ++k) found += solve(solver, b - cloth.K * found);
  EXPECT_LT((x - found).norm() / x.norm(), 1e-10) << "increments make up for 32 bits";
}

TEST_P(EveryIsa, TakesAnyNumberOfRightHandSidesInAnyLayout) {
  const Cloth cloth(23);
  TreeSolver solver = factored(cloth.K, {.isa = GetParam()});
  for (int columns = 1; columns <= 8; ++columns) {
    const Eigen::MatrixXd x = Eigen::MatrixXd::Random(529, columns);
    Eigen::MatrixXd by_columns = cloth.K * x;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> by_rows = by_columns;
    ASSERT_EQ(solver.solve(by_columns.data(), by_columns.data(), columns, 1, 529), SolveStatus::Ok);
    ASSERT_EQ(solver.solve(by_rows.data(), by_rows.data(), columns, columns, 1), SolveStatus::Ok);
    EXPECT_LT((by_columns - x).norm(), 1e-8 * x.norm());
    EXPECT_TRUE(by_rows == by_columns);
  }
}

/// With a limit of 0 no pivot block is inverted; the other path must be as good.
TEST_P(EveryIsa, SubstitutesWhereInversesAreNotStable) {
  const Cloth cloth(40);
  const Positions b = testing::random_positions(1600, 1, 4);
  for (const Precision precision : {Precision::Double, Precision::Single}) {
    TreeSolver solver = factored(
        cloth.K,
        {.precision = precision, .contraction_limit = 0, .condition_limit = 0, .isa = GetParam()});
    EXPECT_EQ(solver.report().substituted_panels, solver.report().panels);
    EXPECT_LT(backward_error(cloth.K, solve(solver, b), b),
              precision == Precision::Double ? 1e-15 : 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(TreeSolver, EveryIsa, ::testing::ValuesIn(available_isas()),
                         [](const auto& isa) {
                           std::string name = to_string(isa.param);
                           std::erase(name, '-');
                           return name;
                         });

TEST(TreeSolver, FollowsTheBordersOfDomains) {
  const Cloth cloth(70);
  const Positions b = testing::random_positions(4900, 1, 5);
  for (const int domains : {1, 2, 3, 7, 16, 64, 512}) {
    const Borders borders(cloth, domains);
    const DomainTree tree = borders.tree();
    TreeSolver solver = factored(cloth.K, {}, &tree);
    EXPECT_LT(backward_error(cloth.K, solve(solver, b), b), 1e-13) << domains << " domains";
  }
}

TEST(TreeSolver, ClosedMeshesAndSeveralComponents) {
  for (const auto& mesh :
       {testing::sphere_mesh(3),
        testing::disjoint_union(testing::sphere_mesh(2), testing::grid_mesh(9, 31))}) {
    const Cloth cloth(mesh);
    const Borders borders(cloth, 5);
    const DomainTree tree = borders.tree();
    const Positions b = testing::random_positions(cloth.model.num_vertices(), 1, 6);
    TreeSolver solver = factored(cloth.K, {}, &tree);
    EXPECT_LT(backward_error(cloth.K, solve(solver, b), b), 1e-13);
  }
}

TEST(TreeSolver, ThreadsDoNotChangeTheBits) {
  const Cloth cloth(150);
  const Positions b = testing::random_positions(22500, 1, 7);
  for (const Precision precision : {Precision::Double, Precision::Single}) {
    Positions reference;
    for (const int threads : {1, 2, 3, 8}) {
      ThreadPool pool(threads);
      const Positions x = pool.run([&] {
        TreeSolver solver = factored(cloth.K, {.precision = precision, .factor_in_single = true});
        EXPECT_GT(solver.report().levels, 1) << "the top of the tree must be part of the test";
        EXPECT_GT(solver.report().subtrees, 4);
        return solve(solver, b);
      });
      if (reference.size() == 0) reference = x;
      EXPECT_TRUE(x == reference) << threads << " threads";
    }
  }
}

/// Hard matrices: what a method may lose shows in the backward error.
TEST(TreeSolver, IsBackwardStableAtTheExtremes) {
  struct Extreme {
    const char* name;
    model::Material material;
    double h;
    double contrast;  ///< of the stiffness between two halves
    double mass;      ///< factor on the mass of every third vertex
  };
  const std::vector<Extreme> extremes{
      {"tiny step", {0.5, 2e4, 2e-2}, 1e-6, 1, 1},
      {"huge step", {0.5, 2e4, 2e-2}, 1e2, 1, 1},
      {"stiff", {0.5, 1e9, 2e-2}, kH, 1, 1},
      {"stiff bending", {0.5, 1, 1e6}, kH, 1, 1},
      {"contrast", {0.5, 2e4, 2e-2}, kH, 1e8, 1},
      {"nearly massless", {0.5, 2e4, 2e-2}, kH, 1, 1e-12},
  };
  for (const Extreme& extreme : extremes) {
    auto model = testing::cloth_model(testing::grid_mesh(48, 48), extreme.material);
    for (std::size_t i = 0; i < model.stretch.size(); ++i)
      if (i % 7 < 3) model.stretch[i].weight *= extreme.contrast;
    for (int v = 0; v < model.num_vertices(); v += 3) model.mass[v] *= extreme.mass;
    const SparseMatrix K = model::assemble_system(model, extreme.h);
    const Positions b = testing::random_positions(model.num_vertices(), 1, 8);
    TreeSolver solver = factored(K);
    EXPECT_LT(backward_error(K, solve(solver, b), b), 1e-13) << extreme.name;
    TreeSolver single = factored(K, {.precision = Precision::Single});
    if (single.report().precision == Precision::Double) {
      EXPECT_FALSE(single.report().fallback.empty()) << extreme.name;
      EXPECT_LT(backward_error(K, solve(single, b), b), 1e-13) << extreme.name;
    } else {
      EXPECT_LE(single.report().contraction, 1e-2) << extreme.name;
    }
  }
}

TEST(TreeSolver, FallsBackTo64BitsWithAReason) {
  const Cloth cloth(testing::grid_mesh(30, 30), {0.5, 2e4, 2e-2}, 1e2);
  TreeSolver solver = factored(cloth.K, {.precision = Precision::Single});
  EXPECT_EQ(solver.report().precision, Precision::Double);
  EXPECT_NE(solver.report().fallback, "");
  EXPECT_NE(solver.description().find("64-bit"), std::string::npos);
}

TEST(TreeSolver, RandomMatricesThatAreNoMeshes) {
  Random random(11);
  for (const int n : {1, 2, 5, 17, 64, 200, 333}) {
    SparseMatrix A(n, n);
    std::vector<Eigen::Triplet<double, int>> entries;
    for (int i = 0; i < n; ++i) entries.emplace_back(i, i, 1e-3 + random.uniform());
    for (int k = 0; k < 3 * n; ++k) {  // sums of w (e_i - e_j)(e_i - e_j)^T
      const auto i = static_cast<int>(random.next() % static_cast<unsigned>(n));
      const auto j = static_cast<int>(random.next() % static_cast<unsigned>(n));
      if (i == j) continue;
      const double w = std::pow(10.0, random.uniform(-4, 4));
      for (const auto& [r, c, v] : {std::tuple(i, i, w), {j, j, w}, {i, j, -w}, {j, i, -w}})
        entries.emplace_back(r, c, v);
    }
    A.setFromTriplets(entries.begin(), entries.end());
    const Positions b = testing::random_positions(n, 1, 9);
    TreeSolver solver = factored(A);
    EXPECT_LT(backward_error(A, solve(solver, b), b), 1e-13) << n;
    const SparseMatrix lower = A.triangularView<Eigen::Lower>();
    TreeSolver from_lower = factored(lower);
    EXPECT_TRUE(solve(from_lower, b) == solve(solver, b)) << "one triangle is enough";
  }
}

TEST(TreeSolver, RefactorsOnTheSamePattern) {
  const Cloth cloth(30);
  TreeSolver solver = factored(cloth.K);
  SparseMatrix other = cloth.K;
  other.diagonal() *= 3;
  ASSERT_EQ(solver.factor(values_of(other)), SolveStatus::Ok);
  const Positions b = testing::random_positions(900, 1, 10);
  EXPECT_LT(backward_error(other, solve(solver, b), b), 1e-14);
}

/// A few rows change: the part of the tree that is factored anew must give the bits of the whole.
TEST(TreeSolver, RefactorsChangedRowsOnly) {
  const Cloth cloth(150);
  const Positions b = testing::random_positions(22500, 1, 14);
  for (const TreeOptions& options :
       {TreeOptions{.partial_refactor = true},
        TreeOptions{
            .precision = Precision::Single, .factor_in_single = true, .partial_refactor = true},
        TreeOptions{}}) {
    TreeSolver parts = factored(cloth.K, options);
    ASSERT_GT(parts.report().subtrees, 4);
    SparseMatrix K = cloth.K;
    for (const std::vector<int>& rows : {std::vector{5}, {7000, 7001, 20000}, {}, {0, 22499}}) {
      for (const int row : rows) K.coeffRef(row, row) *= 50;
      ASSERT_EQ(parts.refactor_rows(values_of(K), rows), SolveStatus::Ok);
      TreeSolver whole = factored(K, options);
      EXPECT_TRUE(solve(parts, b) == solve(whole, b)) << rows.size() << " rows";
    }
  }
  TreeSolver parts = factored(cloth.K, {.partial_refactor = true});
  SparseMatrix K = cloth.K;
  K.coeffRef(77, 77) = -1;
  const std::vector<int> rows{77};
  EXPECT_EQ(parts.refactor_rows(values_of(K), rows), SolveStatus::NotPositiveDefinite);
  EXPECT_EQ(parts.refactor_rows(values_of(cloth.K), rows), SolveStatus::Ok) << "all, from scratch";
  EXPECT_LT(backward_error(cloth.K, solve(parts, b), b), 1e-13);
  const std::vector<int> outside{22500};
  EXPECT_THROW((void)parts.refactor_rows(values_of(cloth.K), outside), InputError);
}

/// K with three right-hand sides and a second matrix of its pattern with one.
TEST(TreeSolver, TwoMatricesOfOnePatternAreSolvedTogether) {
  const Cloth cloth(100);
  SparseMatrix other = cloth.K;
  other.diagonal() *= 2;
  const Positions b = testing::random_positions(10000, 1, 15);
  const Eigen::VectorXd d = b.col(1);
  for (const Precision precision : {Precision::Double, Precision::Single}) {
    TreeSolver K = factored(cloth.K, {.precision = precision});
    TreeSolver N({.precision = precision});
    N.share_analysis(K);
    EXPECT_EQ(N.report().analyze_ms, 0);
    ASSERT_EQ(N.factor(values_of(other)), SolveStatus::Ok);
    Positions x(10000, 3);
    Eigen::VectorXd y(10000);
    ASSERT_EQ(K.solve_with(b.data(), x.data(), 3, N, d.data(), y.data(), 1, 3, 1), SolveStatus::Ok);
    EXPECT_TRUE(x == solve(K, b));
    Eigen::VectorXd alone(10000);
    ASSERT_EQ(N.solve(d.data(), alone.data(), 1, 1, 1), SolveStatus::Ok);
    EXPECT_TRUE(y == alone);
    EXPECT_LT((other * y - d).norm() / d.norm(), precision == Precision::Double ? 1e-10 : 1e-2);
  }
  TreeSolver K = factored(cloth.K);
  TreeSolver none;
  EXPECT_EQ(K.solve_with(b.data(), nullptr, 3, none, d.data(), nullptr, 1, 3, 1),
            SolveStatus::NotFactored);
}

TEST(TreeSolver, WhatIsNotPositiveDefiniteIsAStatus) {
  const Cloth cloth(20);
  const Positions b = Positions::Constant(400, 3, 42);
  for (const double bad : {-1.0, 0.0, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    SparseMatrix K = cloth.K;
    K.coeffRef(123, 123) = bad;
    for (const Precision precision : {Precision::Double, Precision::Single}) {
      TreeSolver solver({.precision = precision});
      solver.analyze(pattern_of(K));
      EXPECT_EQ(solver.factor(values_of(K)), SolveStatus::NotPositiveDefinite) << bad;
      Positions x = b;
      EXPECT_EQ(solver.solve(b.data(), x.data(), 3, 3, 1), SolveStatus::NotFactored);
      EXPECT_TRUE(x == b);
    }
  }
  TreeSolver fresh;
  double one = 1;
  EXPECT_EQ(fresh.factor({}), SolveStatus::NotFactored);
  EXPECT_EQ(fresh.solve(&one, &one, 1, 1, 1), SolveStatus::NotFactored);
}

TEST(TreeSolver, EmptyDiagonalAndOneByOne) {
  TreeSolver empty;
  empty.analyze({});
  EXPECT_EQ(empty.factor({}), SolveStatus::Ok);
  EXPECT_EQ(empty.solve(nullptr, nullptr, 3, 3, 1), SolveStatus::Ok);

  SparseMatrix diagonal(500, 500);
  for (int i = 0; i < 500; ++i) diagonal.insert(i, i) = 1 + i;
  diagonal.makeCompressed();
  TreeSolver solver = factored(diagonal);
  const Positions x = solve(solver, Positions::Ones(500, 3));
  for (int i = 0; i < 500; ++i) EXPECT_NEAR(x(i, 1), 1.0 / (1 + i), 1e-15);
}

TEST(TreeSolver, MalformedPatternsAreRefused) {
  const std::vector<int> begin{0, 1, 2};
  const std::vector<int> rows{0, 2};
  EXPECT_THROW(TreeSolver().analyze({begin, rows}), InputError);
  const std::vector<int> backwards{0, 2, 1};
  EXPECT_THROW(TreeSolver().analyze({backwards, rows}), InputError);
  const std::vector<int> long_begin{0, 1, 9};
  EXPECT_THROW(TreeSolver().analyze({long_begin, rows}), InputError);

  const std::vector<int> good_rows{0, 1};
  const SymmetricPattern good{begin, good_rows};
  const std::vector<int> parents{-1, 0, 0};
  for (const std::vector<int>& nodes : {std::vector{0}, {0, 3}, {-1, 0}}) {
    const DomainTree tree{parents, nodes};
    EXPECT_THROW(TreeSolver().analyze(good, &tree), InputError);
  }
  for (const std::vector<int>& boundary : {std::vector{2}, {-1}, {1, 1}})
    EXPECT_THROW(TreeSolver().analyze(good, nullptr, boundary), InputError);
  TreeSolver solver;
  solver.analyze(good);
  EXPECT_THROW((void)solver.factor(std::vector{1.0}), InputError);
  EXPECT_EQ(solver.factor(std::vector{1.0, 2.0}), SolveStatus::Ok);
}

/// Rows kept to the end: Schur complement and the two half solves against dense algebra.
TEST(TreeSolver, BoundaryIsCondensedAndExpanded) {
  const Cloth cloth(16);
  const int n = 256;
  std::vector<int> boundary;
  for (int v = 3; v < n; v += 9) boundary.push_back(v);
  std::vector<int> inner;
  for (int v = 0; v < n; ++v)
    if (v % 9 != 3) inner.push_back(v);
  const Eigen::MatrixXd K(cloth.K);
  const Eigen::MatrixXd A_ii = K(inner, inner);
  const Eigen::MatrixXd A_ib = K(inner, boundary);
  const Eigen::MatrixXd S = K(boundary, boundary) - A_ib.transpose() * A_ii.ldlt().solve(A_ib);

  TreeSolver solver;
  solver.analyze(pattern_of(cloth.K), nullptr, boundary);
  ASSERT_EQ(solver.factor(values_of(cloth.K)), SolveStatus::Ok);
  const auto nb = static_cast<Eigen::Index>(boundary.size());
  const Eigen::Map<const Eigen::MatrixXd> schur(solver.schur().data(), nb, nb);
  for (Eigen::Index c = 0; c < nb; ++c)
    for (Eigen::Index r = c; r < nb; ++r)
      EXPECT_NEAR(schur(r, c), S(r, c), 1e-9 * S.cwiseAbs().maxCoeff());

  const Positions x = testing::random_positions(n, 1, 12);
  const Positions b = cloth.K * x;
  Eigen::MatrixXd condensed = Eigen::MatrixXd(b)(boundary, Eigen::all);
  ASSERT_EQ(solver.condense(b.data(), 3, 3, 1, condensed.data()), SolveStatus::Ok);
  const Eigen::MatrixXd x_boundary = S.ldlt().solve(condensed);
  EXPECT_LT((x_boundary - Eigen::MatrixXd(x)(boundary, Eigen::all)).norm(), 1e-8);
  Positions found = Positions::Zero(n, 3);
  ASSERT_EQ(solver.expand(x_boundary.data(), found.data(), 3, 3, 1), SolveStatus::Ok);
  EXPECT_LT(
      (Eigen::MatrixXd(found)(inner, Eigen::all) - Eigen::MatrixXd(x)(inner, Eigen::all)).norm(),
      1e-8);
}

/// A full 3n x 3n matrix, as Newton-type methods have it: one right-hand side, blocks of three.
TEST(TreeSolver, FactorsMatricesOfThreeByThreeBlocks) {
  const Cloth cloth(20);
  std::vector<Eigen::Triplet<double, int>> entries;
  Random random(13);
  for (int c = 0; c < 400; ++c)
    for (SparseMatrix::InnerIterator it(cloth.K, c); it; ++it)
      for (int a = 0; a < 3; ++a) {
        entries.emplace_back(3 * static_cast<int>(it.row()) + a, 3 * c + a, it.value());
        if (it.row() != c) continue;
        for (int d = 0; d < a; ++d) {  // couples x, y, z of a vertex, weakly
          const double v = 0.1 * it.value() * random.uniform();
          entries.emplace_back(3 * c + a, 3 * c + d, v);
          entries.emplace_back(3 * c + d, 3 * c + a, v);
        }
      }
  SparseMatrix H(1200, 1200);
  H.setFromTriplets(entries.begin(), entries.end());
  for (int i = 0; i < 1200; ++i) H.coeffRef(i, i) *= 1.3;
  TreeSolver solver = factored(H);
  const Eigen::VectorXd x = Eigen::VectorXd::Random(1200);
  Eigen::VectorXd b = H * x;
  ASSERT_EQ(solver.solve(b.data(), b.data(), 1, 1, 1200), SolveStatus::Ok);
  EXPECT_LT((b - x).norm() / x.norm(), 1e-10);
}

}  // namespace
}  // namespace piecework::global
