#include <piecework/pd/normal_matrix.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <Eigen/Eigenvalues>

#include <gtest/gtest.h>

#include <piecework/core/parallel.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/testing/jolted_cloth.hpp>
#include <piecework/testing/patchwork.hpp>

namespace piecework::pd {
namespace {

using testing::JoltedCloth;

/// Hessian of the incremental potential by central differences of an independent gradient.
Eigen::MatrixXd hessian(const JoltedCloth& cloth, const Positions& x) {
  constexpr double kStep = 1e-6;
  testing::OracleProblem problem = cloth.oracle();
  problem.fixed.assign(problem.fixed.size(), 0);
  const auto size = 3 * x.rows();
  Eigen::MatrixXd H(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    Positions high = x;
    Positions low = x;
    high.data()[i] += kStep;
    low.data()[i] -= kStep;
    const Positions difference =
        (testing::oracle_gradient(problem, high) - testing::oracle_gradient(problem, low)) /
        (2 * kStep);
    H.col(i) = Eigen::Map<const Eigen::VectorXd>(difference.data(), size);
  }
  return H;
}

struct Assembled {
  model::Reduction reduction;
  SparseMatrix K;
  NormalMatrix normal;
  Eigen::MatrixXd Kn, N;

  Assembled(const model::ClothModel& model, const std::vector<char>& fixed, const Positions& x)
      : reduction(model, fixed),
        K(reduction.system(assemble_system(model, JoltedCloth::kH))),
        normal(model, reduction, K) {
    normal.find_normals(x);
    const std::span<const double> values = normal.assemble(x);
    SparseMatrix lower = K;
    std::copy(values.begin(), values.end(), lower.valuePtr());
    const Eigen::MatrixXd dense = lower;
    Kn = dense.selfadjointView<Eigen::Lower>();
    // N maps unknowns to displacements of all vertices along the unknowns' normals.
    N = Eigen::MatrixXd::Zero(3 * x.rows(), reduction.count());
    for (int v = 0; v < model.num_vertices(); ++v)
      model.sewing.map().visit_carriers(v, [&](int carrier, double weight) {
        const int unknown = reduction.number(carrier);
        if (unknown >= 0)
          N.block<3, 1>(3 * v, unknown) += weight * normal.normals().row(unknown).transpose();
      });
  }
  Assembled(const Assembled&) = delete;
  Assembled& operator=(const Assembled&) = delete;
};

/// Everything stretched, so that nothing needs to be clamped and the projected Hessian is exact.
Positions stretched(const JoltedCloth& cloth) {
  Positions x =
      1.3 * cloth.rest.positions + testing::random_positions(cloth.rest.num_vertices(), 0.002, 3);
  for (int v = 0; v < x.rows(); ++v) x(v, 1) += 0.3 * x(v, 0) * x(v, 2);
  return x;
}

TEST(NormalMatrix, IsTheHessianAlongTheNormals) {
  for (const bool bends : {false, true}) {
    const JoltedCloth cloth(
        testing::grid_mesh(5, 5, 0.3),
        {.density = 0.5, .stretching = 200, .bending = bends ? std::optional(1e-2) : std::nullopt},
        0);
    const Positions x = stretched(cloth);
    const Assembled a(cloth.model, cloth.fixed, x);
    const Eigen::MatrixXd expected = a.N.transpose() * hessian(cloth, x) * a.N;
    EXPECT_LT((a.Kn - expected).norm(), 1e-6 * expected.norm()) << bends;
    const Eigen::MatrixXd K = a.K;
    EXPECT_GT((K - expected).norm(), 0.1 * expected.norm()) << "K itself will not do";
  }
}

TEST(NormalMatrix, WithSeamsAsWell) {
  JoltedCloth cloth(testing::patchwork(testing::four_patches()),
                    {.density = 0.5, .stretching = 200, .bending = std::nullopt}, 0);
  const auto stitches = testing::geometric_stitches(testing::four_patches());
  cloth.model.sewing = model::Sewing(
      mesh::resolve_seams(stitches, cloth.model.num_vertices(), testing::plain_names()),
      cloth.model.start);
  Positions x = 1.3 * cloth.rest.positions;
  for (int v = 0; v < x.rows(); ++v) x(v, 1) += 0.3 * x(v, 0) * x(v, 2);
  cloth.model.sewing.follow(1.0, x);
  const Assembled a(cloth.model, cloth.fixed, x);
  ASSERT_LT(a.reduction.count(), cloth.model.num_vertices() - 20);
  const Eigen::MatrixXd expected = a.N.transpose() * hessian(cloth, x) * a.N;
  // K couples slaves with the normals of what carries them; where these differ a little is left.
  EXPECT_LT((a.Kn - expected).norm(), 1e-6 * expected.norm());
}

TEST(NormalMatrix, StaysPositiveDefiniteAndBelowKUnderCompression) {
  const JoltedCloth cloth(testing::grid_mesh(6, 6, 0.3), testing::cotton(1e-4), 0);
  for (const double scale : {0.9, 0.3, 1e-3}) {
    const Positions x =
        scale * cloth.rest.positions + testing::random_positions(36, 0.02 * scale, 5);
    const Assembled a(cloth.model, cloth.fixed, x);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> kn(a.Kn);
    EXPECT_GT(kn.eigenvalues()[0], 0) << scale;
    // N^T H N <= N^T (K x I) N, since K majorises.
    const Eigen::MatrixXd K = a.K;
    const Eigen::MatrixXd gram = a.normal.normals() * a.normal.normals().transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gap(K.cwiseProduct(gram) - a.Kn);
    EXPECT_GT(gap.eigenvalues()[0], -1e-9 * K.norm()) << scale;
  }
}

TEST(NormalMatrix, DegenerateClothKeepsStiffnessAndUnitNormals) {
  const JoltedCloth cloth(testing::grid_mesh(5, 5, 0.3), testing::cotton(1e-4), 0);
  Positions line = cloth.rest.positions;
  line.rightCols<2>().setZero();
  for (const Positions& x : {Positions(Positions::Zero(25, 3)), line}) {
    const Assembled a(cloth.model, cloth.fixed, x);
    EXPECT_TRUE(a.Kn.allFinite());
    EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(a.Kn).info(), Eigen::Success);
    for (int i = 0; i < a.reduction.count(); ++i)
      EXPECT_NEAR(a.normal.normals().row(i).norm(), 1, 1e-12);
  }
}

TEST(NormalMatrix, EveryInstructionSetAgrees) {
  // Stretched, compressed and collapsed triangles side by side, and free lanes in the last batch.
  const JoltedCloth cloth(testing::grid_mesh(8, 8), testing::cotton(1e-3), 0.05);
  Positions x = cloth.z;
  x.row(20) = x.row(21);
  x.row(40) = 0.5 * (x.row(41) + x.row(42));
  const model::Reduction reduction(cloth.model, cloth.fixed);
  const SparseMatrix K = reduction.system(assemble_system(cloth.model, JoltedCloth::kH));
  const auto assembled = [&](Isa isa) {
    NormalMatrix normal(cloth.model, reduction, K, isa);
    normal.find_normals(x);
    const auto values = normal.assemble(x);
    return Eigen::VectorXd(
        Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())));
  };
  const Eigen::VectorXd expected = assembled(Isa::Portable);
  EXPECT_TRUE(expected.allFinite());
  for (const Isa isa : available_isas())
    EXPECT_LT((assembled(isa) - expected).norm(), 1e-12 * expected.norm()) << to_string(isa);
}

TEST(NormalMatrix, SameBitsForEveryThreadCount) {
  const JoltedCloth cloth(testing::grid_mesh(40, 40), testing::cotton(), 0.01);
  const model::Reduction reduction(cloth.model, cloth.fixed);
  const SparseMatrix K = reduction.system(assemble_system(cloth.model, JoltedCloth::kH));
  NormalMatrix normal(cloth.model, reduction, K);
  const auto run = [&](int threads) {
    return ThreadPool(threads).run([&] {
      normal.find_normals(cloth.z);
      const auto values = normal.assemble(cloth.z);
      return std::vector<double>(values.begin(), values.end());
    });
  };
  const auto expected = run(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(run(threads), expected) << threads;
}

}  // namespace
}  // namespace piecework::pd
