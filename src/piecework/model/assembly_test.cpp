#include <piecework/model/assembly.hpp>

#include <algorithm>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/core/error.hpp>
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

/// Stripes of triangles as domains, with the rule of the lower domain for hinges.
struct Stripes {
  Stripes(const ClothModel& model, int num_domains) : domains(num_domains) {
    const auto num_triangles = static_cast<int>(model.triangles.size());
    std::vector<std::vector<int>> of_vertex(static_cast<std::size_t>(model.num_vertices()));
    for (int t = 0; t < num_triangles; ++t) {
      triangle.push_back(t * num_domains / num_triangles);
      for (const int v : model.triangles[static_cast<std::size_t>(t)])
        of_vertex[static_cast<std::size_t>(v)].push_back(triangle.back());
    }
    for (std::size_t i = 0; i < model.hinges.size(); ++i) {
      const auto& [t0, t1] = model.hinges[i].triangles;
      hinge.push_back(
          std::min(triangle[static_cast<std::size_t>(t0)], triangle[static_cast<std::size_t>(t1)]));
      if (model.hinge_bends[i])
        for (const int v : model.hinges[i].vertices)
          of_vertex[static_cast<std::size_t>(v)].push_back(hinge.back());
    }
    vertex.begin.push_back(0);
    for (auto& list : of_vertex) {
      std::sort(list.begin(), list.end());
      vertex.item.insert(vertex.item.end(), list.begin(), std::unique(list.begin(), list.end()));
      vertex.begin.push_back(static_cast<int>(vertex.item.size()));
    }
  }
  [[nodiscard]] ConstraintOwners owners() const { return {domains, triangle, hinge, vertex}; }

  int domains;
  std::vector<int> triangle, hinge;
  mesh::Adjacency vertex;
};

Eigen::MatrixXd sum(const std::vector<DomainMatrix>& domains, Eigen::Index n) {
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n, n);
  for (const DomainMatrix& domain : domains) K(domain.rows, domain.rows) += domain.K.toDense();
  return K;
}

TEST(DomainSystems, SumToTheWholeAndAreDefinite) {
  for (const bool bending : {false, true}) {
    const auto model = testing::cloth_model(
        testing::grid_mesh(7, 6), testing::cotton(bending ? std::optional(1e-2) : std::nullopt));
    const Stripes stripes(model, 4);
    const auto domains = assemble_domain_systems(model, stripes.owners(), 0.01);
    ASSERT_EQ(domains.size(), 4U);
    const Eigen::MatrixXd expected = assemble_system(model, 0.01);
    EXPECT_LT((sum(domains, 42) - expected).norm(), 1e-14 * expected.norm());
    std::size_t rows = 0;
    for (const DomainMatrix& domain : domains) {
      rows += domain.rows.size();
      EXPECT_TRUE(std::is_sorted(domain.rows.begin(), domain.rows.end()));
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(domain.K.toDense())
                    .eigenvalues()
                    .minCoeff(),
                0);
    }
    EXPECT_GT(rows, 42U);  // some vertices are shared
  }
}

TEST(DomainSystems, DivideTheMassEvenly) {
  const auto model = testing::cloth_model(testing::grid_mesh(4, 4), testing::cotton(1e-2));
  const Stripes stripes(model, 3);
  const double h = 0.01;
  // Elastic parts have row sums of zero: what is left is mass.
  for (const DomainMatrix& domain : assemble_domain_systems(model, stripes.owners(), h)) {
    const Eigen::VectorXd mass = domain.K * Eigen::VectorXd::Ones(domain.K.cols()) * (h * h);
    for (std::size_t i = 0; i < domain.rows.size(); ++i) {
      const auto v = static_cast<std::size_t>(domain.rows[i]);
      const int copies = stripes.vertex.begin[v + 1] - stripes.vertex.begin[v];
      const double share = model.mass[domain.rows[i]] / copies;
      EXPECT_NEAR(mass[static_cast<Eigen::Index>(i)], share, 1e-12);
    }
  }
}

TEST(DomainSystems, RestrictToFreeVertices) {
  const auto model = testing::cloth_model(testing::grid_mesh(5, 5), testing::cotton(1e-2));
  const Stripes stripes(model, 3);
  std::vector<char> fixed(25, 0);
  fixed[0] = fixed[7] = fixed[24] = 1;
  const FreeVertices free(fixed);
  const auto domains =
      restrict_to_free(assemble_domain_systems(model, stripes.owners(), 0.01), free);
  const Eigen::MatrixXd expected = restrict_to_free(assemble_system(model, 0.01), free);
  EXPECT_LT((sum(domains, 22) - expected).norm(), 1e-14 * expected.norm());
}

TEST(DomainSystems, VertexWithoutConstraintsGoesToDomainZero) {
  auto model = testing::cloth_model(testing::grid_mesh(3, 3), testing::cotton());
  Stripes stripes(model, 2);
  model.mass.conservativeResize(10);
  model.mass[9] = 5;
  stripes.vertex.begin.push_back(stripes.vertex.begin.back());
  const auto domains = assemble_domain_systems(model, stripes.owners(), 1.0);
  EXPECT_EQ(domains[0].rows.back(), 9);
  EXPECT_EQ(domains[0].K.coeff(domains[0].K.rows() - 1, domains[0].K.rows() - 1), 5);
}

TEST(DomainSystems, RefusesOwnersThatDoNotFit) {
  const auto model = testing::cloth_model(testing::grid_mesh(3, 3), testing::cotton(1e-2));
  const Stripes good(model, 2);
  Stripes bad = good;
  bad.triangle.pop_back();
  EXPECT_THROW(assemble_domain_systems(model, bad.owners(), 1), InputError);
  bad = good;
  bad.triangle[0] = 2;  // not a domain
  EXPECT_THROW(assemble_domain_systems(model, bad.owners(), 1), InputError);
  bad = good;
  bad.triangle[0] = 1;  // a domain that its vertices do not list
  EXPECT_THROW(assemble_domain_systems(model, bad.owners(), 1), InputError);
  bad = good;
  bad.vertex.item[0] = -1;
  EXPECT_THROW(assemble_domain_systems(model, bad.owners(), 1), InputError);
}

}  // namespace
}  // namespace piecework::model
