#include <piecework/local/jacobi.hpp>

#include <algorithm>
#include <limits>
#include <string>

#include <gtest/gtest.h>
#include <Eigen/SVD>

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

using Wide = long double;
using WidePositions = Eigen::Matrix<Wide, Eigen::Dynamic, 3>;

struct WideEvaluation {
  Wide stretch = 0, bend = 0, inertia = 0;
  WidePositions gradient;
  [[nodiscard]] Wide energy() const { return stretch + bend + inertia; }
};

void add_triangle(const model::StretchConstraint& c, const WidePositions& x, WideEvaluation& out) {
  Eigen::Matrix<Wide, 3, 2> edges;
  for (int k = 0; k < 2; ++k)
    edges.col(k) =
        (x.row(c.vertices[static_cast<std::size_t>(k + 1)]) - x.row(c.vertices[0])).transpose();
  const Eigen::Matrix<Wide, 3, 2> F = edges * c.rest_inverse.cast<Wide>();
  const Eigen::JacobiSVD<Eigen::Matrix<Wide, 3, 2>> svd(F,
                                                        Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix<Wide, 3, 2> difference =
      F - svd.matrixU().leftCols<2>() * svd.matrixV().transpose();
  const Eigen::Matrix<Wide, 2, 3> force =
      Wide(c.weight) * c.rest_inverse.cast<Wide>() * difference.transpose();
  out.gradient.row(c.vertices[0]) -= force.colwise().sum();
  out.gradient.row(c.vertices[1]) += force.row(0);
  out.gradient.row(c.vertices[2]) += force.row(1);
  out.stretch += Wide(c.weight) / 2 * difference.squaredNorm();
}

void add_hinge(const model::BendConstraint& c, const WidePositions& x, WideEvaluation& out) {
  Eigen::Matrix<Wide, 1, 3> value = Eigen::Matrix<Wide, 1, 3>::Zero();
  for (std::size_t k = 1; k < 4; ++k)
    value += Wide(c.coefficient[k]) * (x.row(c.vertices[k]) - x.row(c.vertices[0]));
  const Eigen::Matrix<Wide, 1, 3> off = value - value.normalized() * Wide(c.rest_length);
  for (std::size_t k = 0; k < 4; ++k)
    out.gradient.row(c.vertices[k]) += Wide(c.weight) * Wide(c.coefficient[k]) * off;
  out.bend += Wide(c.weight) / 2 * off.squaredNorm();
}

/// One constraint after the other, singular values, extended precision.
WideEvaluation evaluate_wide(const model::ClothModel& model, const Positions& narrow,
                             const Positions& z, const std::vector<char>& fixed) {
  WideEvaluation out;
  const WidePositions x = narrow.cast<Wide>();
  out.gradient = WidePositions::Zero(x.rows(), 3);
  for (const auto& c : model.stretch) add_triangle(c, x, out);
  for (const auto& c : model.bend) add_hinge(c, x, out);
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    const Wide inertia = Wide(model.mass[v]) / (Wide(kH) * Wide(kH));
    const Eigen::Matrix<Wide, 1, 3> offset = x.row(v) - z.cast<Wide>().row(v);
    out.gradient.row(v) += inertia * offset;
    if (fixed[static_cast<std::size_t>(v)] != 0)
      out.gradient.row(v).setZero();
    else
      out.inertia += inertia / 2 * offset.squaredNorm();
  }
  return out;
}

class JacobiOnEveryIsa : public ::testing::TestWithParam<Isa> {};

// Many patches, curved and flat hinges, two cloths, held vertices, one without constraints.
TEST_P(JacobiOnEveryIsa, AgreesWithAPlainLoop) {
  auto rest = piecework::testing::disjoint_union(piecework::testing::grid_mesh(58, 44),
                                                 piecework::testing::sphere_mesh(4));
  rest.positions.conservativeResize(rest.positions.rows() + 1, 3);
  rest.positions.bottomRows(1).setZero();
  const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton(1e-3));
  ASSERT_GT(model.stretch.size(), 8 * 512U) << "too small for several patches";
  ASSERT_NE(model.stretch.size() % 8, 0U) << "no batch with room left";
  const Positions x =
      rest.positions + piecework::testing::random_positions(rest.num_vertices(), 3e-3, 5);
  const Positions z =
      rest.positions + piecework::testing::random_positions(rest.num_vertices(), 3e-3, 6);
  std::vector<char> fixed(static_cast<std::size_t>(rest.num_vertices()), 0);
  for (std::size_t v = 0; v < fixed.size(); v += 7) fixed[v] = 1;
  Positions gradient;
  const auto result =
      JacobiStep(model, kH, GetParam()).evaluate(x, {&z, &fixed, &model.start}, gradient);
  const WideEvaluation expected = evaluate_wide(model, x, z, fixed);
  EXPECT_NEAR(result.energy, static_cast<double>(expected.energy()), 1e-14 * result.energy);
  EXPECT_LT((gradient - expected.gradient.cast<double>()).cwiseAbs().maxCoeff(),
            1e-13 * expected.gradient.cast<double>().cwiseAbs().maxCoeff());
  EXPECT_EQ(result.degenerate, 0);
  for (std::size_t v = 0; v < fixed.size(); v += 7)
    EXPECT_TRUE(gradient.row(static_cast<Eigen::Index>(v)).isZero(0));
}

// Some lanes degenerate, their neighbours not; the rule for them is that of the plain loop.
TEST_P(JacobiOnEveryIsa, DegenerateLanesAreDoneApart) {
  const auto rest = piecework::testing::grid_mesh(40, 40);
  const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton(1e-3));
  Positions x = rest.positions + piecework::testing::random_positions(1600, 3e-3, 5);
  for (const int t : {3, 700, 1801, 3041}) {  // full rank before, a needle of no width now
    const Triangle& v = model.triangles[static_cast<std::size_t>(t)];
    x.row(v[2]) = 0.75 * x.row(v[0]) + 0.25 * x.row(v[1]);
  }
  const std::vector<char> fixed(1600, 0);
  Positions gradient;
  const auto result =
      JacobiStep(model, kH, GetParam()).evaluate(x, {&x, &fixed, &rest.positions}, gradient);
  EXPECT_EQ(result.degenerate, 4);
  // Which isometry a degenerate triangle chooses does not change its energy.
  const WideEvaluation expected = evaluate_wide(model, x, x, fixed);
  EXPECT_NEAR(result.energy, static_cast<double>(expected.energy()), 1e-13 * result.energy);
  const double size = gradient.cwiseAbs().maxCoeff();
  const Positions difference = gradient - expected.gradient.cast<double>();
  int elsewhere = 0;
  for (Eigen::Index v = 0; v < 1600; ++v)
    if (difference.row(v).norm() > 1e-12 * size) ++elsewhere;
  EXPECT_LE(elsewhere, 12) << "only corners of degenerate triangles may choose";
  EXPECT_LT(gradient.colwise().sum().norm(), 1e-10 * size);
}

// The energy of bending is as good as the curvature, however flat the sheet and however far away.
TEST_P(JacobiOnEveryIsa, EnergyOfBendingDoesNotCancel) {
  const auto rest = piecework::testing::grid_mesh(33, 29);
  const auto model = piecework::testing::cloth_model(rest, {.stretching = 0, .bending = 1e-3});
  const std::vector<char> fixed(static_cast<std::size_t>(rest.num_vertices()), 0);
  for (const double offset : {0.0, 1e6})
    for (const double height : {1e-2, 1e-5}) {
      Positions x = rest.positions;
      for (Eigen::Index v = 0; v < x.rows(); ++v)
        x(v, 1) = height * std::sin(3 * x(v, 0)) * std::cos(2 * x(v, 2));
      x.rowwise() += Eigen::RowVector3d(offset, -offset, offset);
      Positions gradient;
      const auto result = JacobiStep(model, kH, GetParam()).evaluate(x, {&x, &fixed, &x}, gradient);
      const auto expected = static_cast<double>(evaluate_wide(model, x, x, fixed).bend);
      // c^T x itself is rounded: relative to its size, which the curvature makes small.
      const double tolerance = offset > 0 ? 1e-13 : height > 1e-3 ? 1e-13 : 1e-10;
      EXPECT_NEAR(result.energy, expected, tolerance * expected)
          << "offset " << offset << ", height " << height;
    }
}

// What a line search sees: the difference of two energies, to 1e-13 of the energy.
TEST_P(JacobiOnEveryIsa, EnergyDifferencesAreGoodForALineSearch) {
  const auto rest = piecework::testing::grid_mesh(60, 60);
  const auto model = piecework::testing::cloth_model(rest, piecework::testing::cotton());
  const std::vector<char> fixed(3600, 0);
  Positions x = rest.positions + piecework::testing::random_positions(3600, 1e-3, 5);
  x.rowwise() += Eigen::RowVector3d(1e6, 0, -1e6);
  const Positions z = x + piecework::testing::random_positions(3600, 1e-3, 6);
  const Positions y = x + piecework::testing::random_positions(3600, 1e-8, 7);
  JacobiStep step(model, kH, GetParam());
  Positions gradient;
  const double at_x = step.evaluate(x, {&z, &fixed, &x}, gradient).energy;
  const double at_y = step.evaluate(y, {&z, &fixed, &x}, gradient).energy;
  const auto expected = static_cast<double>(evaluate_wide(model, y, z, fixed).energy() -
                                            evaluate_wide(model, x, z, fixed).energy());
  ASSERT_GT(std::abs(expected), 1e-9 * at_x);
  EXPECT_NEAR(at_y - at_x, expected, 1e-13 * at_x);
}

INSTANTIATE_TEST_SUITE_P(Jacobi, JacobiOnEveryIsa, ::testing::ValuesIn(available_isas()),
                         [](const auto& isa) {
                           std::string name = to_string(isa.param);
                           name.erase(std::remove(name.begin(), name.end(), '-'), name.end());
                           return name;
                         });

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
