#include <piecework/local/jacobi.hpp>

#include <limits>

#include <gtest/gtest.h>

#include <piecework/core/parallel.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/testing/newton_oracle.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::local {
namespace {

constexpr double kH = 1.0 / 120.0;

struct Evaluation {
  JacobiStep::Result result;
  Positions gradient;
};

Evaluation evaluate(const model::ClothModel& model, const Positions& x, const Positions& z,
                    const std::vector<char>& fixed) {
  Evaluation e;
  e.result = JacobiStep(model, kH).evaluate(x, {&z, &fixed, &model.start}, e.gradient);
  return e;
}

class JacobiAgainstOracle : public ::testing::TestWithParam<bool> {};

// Energy from singular values and gradient from central differences in extended precision.
TEST_P(JacobiAgainstOracle, EnergyAndGradientAgree) {
  const mesh::TriangleMesh rest =
      GetParam() ? piecework::testing::sphere_mesh(1) : piecework::testing::grid_mesh(5, 4);
  const auto material = piecework::testing::cotton(2e-2);
  const auto model = piecework::testing::cloth_model(rest, material);
  const Positions x =
      rest.positions + piecework::testing::random_positions(rest.num_vertices(), 0.1, 5);
  const Positions z =
      rest.positions + piecework::testing::random_positions(rest.num_vertices(), 0.1, 6);
  std::vector<char> fixed(static_cast<std::size_t>(rest.num_vertices()), 0);
  fixed[1] = 1;
  const piecework::testing::OracleProblem oracle{&rest, material, kH, z, fixed};
  const Evaluation e = evaluate(model, x, z, fixed);
  EXPECT_NEAR(e.result.energy, oracle_energy(oracle, x), 1e-12 * e.result.energy);
  const Positions expected = oracle_gradient(oracle, x);
  EXPECT_LT((e.gradient - expected).norm(), 1e-9 * expected.norm());
  EXPECT_TRUE(e.gradient.row(1).isZero());
  EXPECT_EQ(e.result.degenerate, 0);
}

INSTANTIATE_TEST_SUITE_P(FlatAndCurved, JacobiAgainstOracle, ::testing::Bool());

TEST(Jacobi, RestShapeHasNoForce) {
  for (const auto& rest :
       {piecework::testing::grid_mesh(6, 6), piecework::testing::sphere_mesh(2)}) {
    const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton(1e-2));
    const Evaluation e =
        evaluate(model, rest.positions, rest.positions,
                 std::vector<char>(static_cast<std::size_t>(rest.num_vertices()), 0));
    EXPECT_LT(e.result.energy, 1e-20);
    EXPECT_LT(e.gradient.norm(), 1e-9);
  }
}

// Internal forces sum to zero, as do their moments: what remains is inertia.
TEST(Jacobi, InternalForcesBalance) {
  const auto rest = piecework::testing::grid_mesh(8, 8);
  const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton(1e-2));
  const Positions x = rest.positions + piecework::testing::random_positions(64, 0.1, 9);
  const Evaluation e = evaluate(model, x, x, std::vector<char>(64, 0));
  EXPECT_GT(e.gradient.norm(), 1);
  EXPECT_LT(e.gradient.colwise().sum().norm(), 1e-10 * e.gradient.norm());
  Vec3 moment = Vec3::Zero();
  for (Eigen::Index v = 0; v < 64; ++v) moment += Vec3(x.row(v)).cross(Vec3(e.gradient.row(v)));
  EXPECT_LT(moment.norm(), 1e-10 * e.gradient.norm());
}

// Where every element is at rest but the sheet is 1e6 m away, differences keep the forces small.
TEST(Jacobi, FarFromTheOrigin) {
  auto rest = piecework::testing::grid_mesh(6, 6);
  const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton(1e-2));
  Positions x = rest.positions;
  x.rowwise() += Eigen::RowVector3d(1e6, -1e6, 1e6);
  const Evaluation e = evaluate(model, x, x, std::vector<char>(36, 0));
  EXPECT_LT(e.gradient.norm(), 261.0 * 36 * 1e-9);
}

TEST(Jacobi, CollapsedClothHasFiniteForces) {
  const auto rest = piecework::testing::grid_mesh(5, 5);
  const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton(1e-2));
  const std::vector<char> fixed(25, 0);
  Positions line = rest.positions;
  line.col(2).setZero();
  const Positions point = Positions::Zero(25, 3);
  for (const Positions& x : {line, point}) {
    Evaluation e;
    e.result = JacobiStep(model, kH).evaluate(x, {&x, &fixed, &x}, e.gradient);
    EXPECT_GT(e.result.degenerate, 0);
    EXPECT_TRUE(e.gradient.allFinite());
    EXPECT_TRUE(std::isfinite(e.result.energy));
    EXPECT_GT(e.gradient.norm(), 0) << "it wants to unfold";
  }
}

TEST(Jacobi, TroubleIsNotHidden) {
  const auto rest = piecework::testing::grid_mesh(4, 4);
  const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton());
  Positions x = rest.positions;
  x(5, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(
      std::isfinite(evaluate(model, x, rest.positions, std::vector<char>(16, 0)).result.energy));
}

TEST(Jacobi, SameBitsForEveryThreadCount) {
  const auto rest = piecework::testing::grid_mesh(60, 60);
  const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton());
  const Positions x = rest.positions + piecework::testing::random_positions(3600, 0.01, 3);
  const std::vector<char> fixed(3600, 0);
  const auto run = [&](int threads) {
    return ThreadPool(threads).run([&] { return evaluate(model, x, rest.positions, fixed); });
  };
  const Evaluation expected = run(1);
  for (const int threads : {2, 3, 8, 8}) {
    const Evaluation e = run(threads);
    EXPECT_EQ(e.result.energy, expected.result.energy);
    EXPECT_TRUE(e.gradient == expected.gradient);
  }
}

}  // namespace
}  // namespace piecework::local
