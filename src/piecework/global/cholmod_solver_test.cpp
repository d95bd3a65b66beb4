#include <piecework/global/cholmod_solver.hpp>

#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/model/assembly.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::global {
namespace {

SparseMatrix cloth_matrix(int side, double h = 1.0 / 120.0) {
  return model::assemble_system(
      testing::cloth_model(testing::grid_mesh(side, side), testing::cotton(1e-3)), h);
}

TEST(CholmodSolver, MatchesADenseSolve) {
  const SparseMatrix K = cloth_matrix(12);
  RightHandSides b = testing::random_positions(144, 1, 7);
  const Eigen::MatrixXd expected = Eigen::MatrixXd(K).fullPivLu().solve(Eigen::MatrixXd(b));
  CholmodSolver solver;
  ASSERT_EQ(solver.factor(K), SolveStatus::Ok);
  ASSERT_EQ(solver.solve(b), SolveStatus::Ok);
  EXPECT_LT((b - expected).norm() / expected.norm(), 1e-12);
  EXPECT_GT(solver.report().nonzeros, 144);
  EXPECT_GT(solver.report().bytes, 0U);
  EXPECT_GT(solver.report().flops, 0);
}

TEST(CholmodSolver, SolvesManyColumns) {
  const SparseMatrix K = cloth_matrix(8);
  CholmodSolver solver;
  Eigen::MatrixXd b = Eigen::MatrixXd::Identity(64, 17);
  EXPECT_EQ(solver.solve_many(b), SolveStatus::NotFactored);
  ASSERT_EQ(solver.factor(K), SolveStatus::Ok);
  ASSERT_EQ(solver.solve_many(b), SolveStatus::Ok);
  EXPECT_LT((K * b - Eigen::MatrixXd::Identity(64, 17)).norm(), 1e-10);
  Eigen::MatrixXd none(64, 0);
  EXPECT_EQ(solver.solve_many(none), SolveStatus::Ok);
}

TEST(CholmodSolver, RefactorsNewValuesOnTheSamePattern) {
  CholmodSolver solver;
  ASSERT_EQ(solver.factor(cloth_matrix(10)), SolveStatus::Ok);
  const SparseMatrix stiffer = cloth_matrix(10, 1.0 / 30.0);
  ASSERT_EQ(solver.refactor(stiffer), SolveStatus::Ok);
  EXPECT_EQ(solver.report().analyze_ms, 0);
  const RightHandSides b = testing::random_positions(100, 1, 8);
  RightHandSides x = b;
  ASSERT_EQ(solver.solve(x), SolveStatus::Ok);
  EXPECT_LT((stiffer * x - b).norm(), 1e-10 * b.norm());
}

// Three coordinates per vertex: groups of rows with one pattern, of which only the lower triangle
// is there.
TEST(CholmodSolver, OrdersGroupsOfRowsAsOne) {
  const SparseMatrix K = cloth_matrix(14);
  std::vector<Eigen::Triplet<double, int>> triplets;
  for (int column = 0; column < K.cols(); ++column)
    for (SparseMatrix::InnerIterator it(K, column); it; ++it)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          triplets.emplace_back(3 * static_cast<int>(it.row()) + i, 3 * column + j,
                                it.value() * (i == j ? 2.0 : 0.5));
  SparseMatrix blocks(3 * K.rows(), 3 * K.rows());
  blocks.setFromTriplets(triplets.begin(), triplets.end());
  const SparseMatrix lower = blocks.triangularView<Eigen::Lower>();

  CholmodSolver solver;
  CholmodSolver plain;
  ASSERT_EQ(solver.analyze(lower, 3), SolveStatus::Ok);
  Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(lower.rows(), -1, 1);
  const Eigen::VectorXd b = x;
  EXPECT_EQ(solver.solve(x.data(), 1), SolveStatus::NotFactored);
  ASSERT_EQ(plain.factor(lower), SolveStatus::Ok);
  EXPECT_LT(solver.report().nonzeros, 1.2 * plain.report().nonzeros) << "as good as row by row";
  for (const double scale : {1.0, 7.0}) {
    ASSERT_EQ(solver.refactor(scale * lower), SolveStatus::Ok);
    x = b;
    ASSERT_EQ(solver.solve(x.data(), 1), SolveStatus::Ok);
    EXPECT_LT((scale * (blocks * x) - b).norm(), 1e-10 * b.norm());
  }
}

TEST(CholmodSolver, IndefiniteMatrixIsAStatusAndDropsTheFactor) {
  CholmodSolver solver;
  ASSERT_EQ(solver.factor(cloth_matrix(6)), SolveStatus::Ok);
  SparseMatrix bad = cloth_matrix(6);
  bad.coeffRef(7, 7) = -1;
  EXPECT_EQ(solver.factor(bad), SolveStatus::NotPositiveDefinite);
  RightHandSides b = RightHandSides::Constant(36, 3, 42);
  EXPECT_EQ(solver.solve(b), SolveStatus::NotFactored);
  EXPECT_TRUE(b == RightHandSides::Constant(36, 3, 42));
}

TEST(CholmodSolver, SmallestPivotFromTheLastOneOfADenseFactor) {
  const SparseMatrix K = cloth_matrix(6);
  CholmodSolver solver;
  EXPECT_EQ(solver.smallest_pivot(K), 0);
  ASSERT_EQ(solver.factor(K), SolveStatus::Ok);
  // Bounds that hold for every order: 1 / (K_ii (K^-1)_ii) is row i's pivot when it comes last.
  const Eigen::MatrixXd inverse = Eigen::MatrixXd(K).inverse();
  double last = 1;
  for (int i = 0; i < 36; ++i) last = std::min(last, 1 / (K.coeff(i, i) * inverse(i, i)));
  EXPECT_GE(solver.smallest_pivot(K), 0.999 * last);
  EXPECT_LT(solver.smallest_pivot(K), 1);
  SparseMatrix singular = cloth_matrix(6);
  for (int i = 0; i < 36; ++i) singular.coeffRef(i, i) -= singular.row(i).sum();
  EXPECT_TRUE(solver.refactor(singular) != SolveStatus::Ok ||
              solver.smallest_pivot(singular) < 1e-14);
}

TEST(CholmodSolver, NanIsNotPositiveDefinite) {
  SparseMatrix bad = cloth_matrix(6);
  bad.coeffRef(7, 7) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(CholmodSolver().factor(bad), SolveStatus::NotPositiveDefinite);
}

TEST(CholmodSolver, BeforeTheFirstFactor) {
  CholmodSolver solver;
  RightHandSides b = RightHandSides::Ones(4, 3);
  EXPECT_EQ(solver.solve(b), SolveStatus::NotFactored);
  EXPECT_EQ(solver.refactor(cloth_matrix(4)), SolveStatus::NotFactored);
}

TEST(CholmodSolver, SizesZeroAndOne) {
  CholmodSolver solver;
  RightHandSides none(0, 3);
  EXPECT_EQ(solver.factor(SparseMatrix(0, 0)), SolveStatus::Ok);
  EXPECT_EQ(solver.solve(none), SolveStatus::Ok);
  SparseMatrix one(1, 1);
  one.insert(0, 0) = 4;
  one.makeCompressed();
  RightHandSides b = RightHandSides::Constant(1, 3, 8);
  EXPECT_EQ(solver.factor(one), SolveStatus::Ok);
  EXPECT_EQ(solver.solve(b), SolveStatus::Ok);
  EXPECT_TRUE(b == RightHandSides::Constant(1, 3, 2));
}

}  // namespace
}  // namespace piecework::global
