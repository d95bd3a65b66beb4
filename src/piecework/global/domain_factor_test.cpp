#include <piecework/global/domain_factor.hpp>

#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/global/dense_cholesky.hpp>
#include <piecework/global/tree_domain.hpp>

#include "decomposed_cloth_test_util.hpp"

namespace piecework::global {
namespace {

/// Every backend must pass these.
class Backend : public ::testing::TestWithParam<bool> {
 public:
  static DomainBackend backend() { return GetParam() ? tree_backend() : reference_backend(); }
};
INSTANTIATE_TEST_SUITE_P(DomainFactor, Backend, ::testing::Bool(),
                         [](const auto& is_tree) { return is_tree.param ? "Tree" : "Reference"; });

TEST_P(Backend, DomainFactorSolvesAndRefactors) {
  const DecomposedCloth cloth = slab_cloth(9, 8, 1);
  auto factor = backend().make_factor();
  ASSERT_EQ(factor->analyze(cloth.K()), SolveStatus::Ok);
  const RightHandSides b = testing::random_positions(72, 1, 2);
  for (const double h : {kStep, 0.1, kStep}) {
    ASSERT_EQ(factor->factorize(cloth.K(h)), SolveStatus::Ok);
    RightHandSides x = b;
    ASSERT_EQ(factor->solve(x), SolveStatus::Ok);
    EXPECT_LT(relative_error(x, undivided_solve(cloth.K(h), b)), 1e-11);
    Eigen::MatrixXd many = b.replicate(1, 3);
    ASSERT_EQ(factor->solve_many(many), SolveStatus::Ok);
    EXPECT_LT((many - x.replicate(1, 3)).norm(), 1e-12 * many.norm());
  }
  EXPECT_GT(factor->bytes(), 72 * sizeof(double));
  EXPECT_GT(factor->nonzeros(), 72);
}

TEST_P(Backend, DomainFactorSingularAndIndefinite) {
  for (const int side : {5, 9, 20, 80}) {
    SCOPED_TRACE(side);
    const DecomposedCloth cloth = slab_cloth(side, side - 1, 1);
    const SparseMatrix good = integer_matrix(cloth, 1e-6);
    auto factor = backend().make_factor();
    ASSERT_EQ(factor->analyze(good), SolveStatus::Ok);
    ASSERT_EQ(factor->factorize(good), SolveStatus::Ok);
    EXPECT_EQ(factor->factorize(integer_matrix(cloth, 0)), SolveStatus::NotPositiveDefinite);
    RightHandSides b = RightHandSides::Ones(good.rows(), 3);
    EXPECT_EQ(factor->solve(b), SolveStatus::NotFactored);
    EXPECT_EQ(factor->factorize(integer_matrix(cloth, -1)), SolveStatus::NotPositiveDefinite);
    EXPECT_EQ(factor->solve(b), SolveStatus::NotFactored);
    EXPECT_EQ(factor->factorize(good), SolveStatus::Ok);
    EXPECT_EQ(factor->solve(b), SolveStatus::Ok);
  }
}

// The interface is solved densely between the sweeps: together they solve K x = b.
TEST_P(Backend, CondensedDomainSchurComplementAndSweeps) {
  const DecomposedCloth cloth = slab_cloth(9, 8, 1);
  for (const int num_internal : {0, 1, 50, 71, 72}) {
    SCOPED_TRACE(num_internal);
    auto factor = backend().make_condensed();
    ASSERT_EQ(factor->analyze(cloth.K(), num_internal), SolveStatus::Ok);
    const int num_interface = 72 - num_internal;
    for (const double h : {kStep, 0.1}) {
      const SparseMatrix K = cloth.K(h);
      const Eigen::MatrixXd dense = K;
      Eigen::MatrixXd S;
      ASSERT_EQ(factor->factorize(K, S), SolveStatus::Ok);
      ASSERT_EQ(S.rows(), num_interface);
      Eigen::MatrixXd expected = dense.bottomRightCorner(num_interface, num_interface);
      if (num_internal > 0)
        expected -= dense.bottomLeftCorner(num_interface, num_internal) *
                    dense.topLeftCorner(num_internal, num_internal).inverse() *
                    dense.topRightCorner(num_internal, num_interface);
      EXPECT_LE((S - expected).norm(), 1e-12 * dense.norm());

      const RightHandSides b = testing::random_positions(72, 1, 2);
      RightHandSides x = b;
      factor->condense(x);
      if (num_interface > 0)
        x.bottomRows(num_interface) = expected.llt().solve(x.bottomRows(num_interface)).eval();
      factor->expand(x);
      EXPECT_LT(relative_error(x, undivided_solve(K, b)), 1e-11);
    }
  }
}

TEST_P(Backend, CondensedDomainOnlyTheInternalBlockNeedsToBeDefinite) {
  const DecomposedCloth cloth = slab_cloth(9, 8, 1);
  SparseMatrix K = cloth.K();
  auto factor = backend().make_condensed();
  Eigen::MatrixXd S;
  K.coeffRef(71, 71) = -100;
  ASSERT_EQ(factor->analyze(K, 60), SolveStatus::Ok);
  EXPECT_EQ(factor->factorize(K, S), SolveStatus::Ok);
  EXPECT_LT(S(11, 11), 0);
  K.coeffRef(5, 5) = -100;
  EXPECT_EQ(factor->factorize(K, S), SolveStatus::NotPositiveDefinite);
  EXPECT_EQ(factor->factorize(cloth.K(), S), SolveStatus::Ok);
}

TEST(DenseCholesky, SolvesAndJudges) {
  DenseCholesky cholesky;
  Eigen::MatrixXd none(0, 3);
  EXPECT_EQ(cholesky.factor(Eigen::MatrixXd(0, 0), 1e-15), SolveStatus::Ok);
  cholesky.solve_in_place(none);

  const Eigen::MatrixXd A = slab_cloth(5, 4, 1).K();
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(20, 20);
  ASSERT_EQ(cholesky.factor(A, pivot_tolerance(20)), SolveStatus::Ok);
  cholesky.solve_in_place(inverse);
  EXPECT_LT((A * inverse - Eigen::MatrixXd::Identity(20, 20)).norm(), 1e-11);

  const DecomposedCloth sheet = slab_cloth(30, 29, 1);
  EXPECT_EQ(cholesky.factor(integer_matrix(sheet, 0).toDense(), pivot_tolerance(870)),
            SolveStatus::NotPositiveDefinite);
  EXPECT_EQ(cholesky.factor(integer_matrix(sheet, 1e-6).toDense(), pivot_tolerance(870)),
            SolveStatus::Ok);
  Eigen::MatrixXd bad = A;
  bad(7, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(cholesky.factor(bad, pivot_tolerance(20)), SolveStatus::NotPositiveDefinite);
  EXPECT_EQ(cholesky.factor(-A, pivot_tolerance(20)), SolveStatus::NotPositiveDefinite);
}

}  // namespace
}  // namespace piecework::global
