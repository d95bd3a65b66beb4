#include <piecework/model/assembly.hpp>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/testing/small_cloths.hpp>

namespace piecework::model {
namespace {

// K built densely from its definition, sum of w_i A_i^T A_i with explicit matrices A_i.
Eigen::MatrixXd dense_system(const ClothModel& model, double h) {
  const Eigen::Index n = model.num_vertices();
  Eigen::MatrixXd K = Eigen::MatrixXd(model.mass.asDiagonal()) / (h * h);
  for (const StretchConstraint& c : model.stretch) {
    Eigen::MatrixXd edges = Eigen::MatrixXd::Zero(2, n);
    edges(0, c.vertices[1]) = edges(1, c.vertices[2]) = 1;
    edges(0, c.vertices[0]) = edges(1, c.vertices[0]) = -1;
    const Eigen::MatrixXd A = c.rest_inverse.transpose() * edges;
    K += c.weight * A.transpose() * A;
  }
  for (const BendConstraint& c : model.bend) {
    Eigen::RowVectorXd A = Eigen::RowVectorXd::Zero(n);
    for (std::size_t i = 0; i < 4; ++i) A[c.vertices[i]] += c.coefficient[i];
    K += c.weight * A.transpose() * A;
  }
  return K;
}

TEST(Assembly, MatchesTheDefinition) {
  const auto model = testing::cloth_model(testing::grid_mesh(6, 5), testing::cotton(1e-2));
  const Eigen::MatrixXd K = assemble_system(model, 0.01);
  const Eigen::MatrixXd expected = dense_system(model, 0.01);
  EXPECT_LT((K - expected).norm(), 1e-12 * expected.norm());
  EXPECT_LT((K - K.transpose()).norm(), 1e-14 * K.norm());
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(K).eigenvalues().minCoeff(), 0);
}

// Translations carry no elastic energy: the rows of K - M/h^2 sum to zero.
TEST(Assembly, IsTranslationInvariant) {
  const auto model = testing::cloth_model(testing::sphere_mesh(1), testing::cotton(1e-2));
  const SparseMatrix K = assemble_system(model, 0.01);
  const Eigen::VectorXd sums = K * Eigen::VectorXd::Ones(K.cols()) - model.mass / 1e-4;
  EXPECT_LT(sums.cwiseAbs().maxCoeff(), 1e-10 * K.coeffs().cwiseAbs().maxCoeff());
}

TEST(Assembly, RestrictionPicksTheFreeRowsAndColumns) {
  const auto model = testing::cloth_model(testing::grid_mesh(4, 4), testing::cotton());
  const SparseMatrix K = assemble_system(model, 0.01);
  std::vector<char> fixed(16, 0);
  fixed[0] = fixed[3] = fixed[15] = 1;
  const FreeVertices free(fixed);
  ASSERT_EQ(free.count(), 13);
  const Eigen::MatrixXd Kff = restrict_to_free(K, free);
  for (int i = 0; i < 13; ++i)
    for (int j = 0; j < 13; ++j)
      EXPECT_EQ(Kff(i, j), K.coeff(free.vertex[static_cast<std::size_t>(i)],
                                   free.vertex[static_cast<std::size_t>(j)]));
}

TEST(Assembly, EverythingFixedLeavesAnEmptySystem) {
  const auto model = testing::cloth_model(testing::grid_mesh(3, 3), testing::cotton());
  const FreeVertices free(std::vector<char>(9, 1));
  EXPECT_EQ(restrict_to_free(assemble_system(model, 0.01), free).rows(), 0);
}

}  // namespace
}  // namespace piecework::model
