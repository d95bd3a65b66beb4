#include <piecework/global/primal_dual.hpp>

#include <limits>
#include <string>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

#include "decomposed_cloth_test_util.hpp"

namespace piecework::global {
namespace {

struct Variant {
  DomainForm form;
  InterfaceKind interface;
  bool tree;  ///< our engine in the domains, or the plain reference
};
constexpr Variant kVariants[] = {{DomainForm::Literal, InterfaceKind::Dense, false},
                                 {DomainForm::Literal, InterfaceKind::Sparse, false},
                                 {DomainForm::OneSweep, InterfaceKind::Dense, false},
                                 {DomainForm::OneSweep, InterfaceKind::Sparse, false},
                                 {DomainForm::Literal, InterfaceKind::Recursive, true},
                                 {DomainForm::OneSweep, InterfaceKind::Recursive, true}};

PrimalDualOptions plain(const Variant& variant) {
  return {.form = variant.form,
          .interface = variant.interface,
          .max_refinements = 0,
          .backend = variant.tree ? tree_backend() : reference_backend()};
}

/// Solves in every variant, without refinement, and compares with K undivided.
/// Returns the largest relative error.
double worst_error(std::span<const DomainMatrix> domains, const SparseMatrix& K,
                   const CornerOptions& corners = {}) {
  const int n = static_cast<int>(K.rows());
  const InterfaceDofs dofs = classify_dofs(domains, n, corners);
  const RightHandSides b = testing::random_positions(n, 1, 11);
  const RightHandSides expected = undivided_solve(K, b);
  double worst = 0;
  for (const Variant& variant : kVariants) {
    PrimalDual solver;
    RightHandSides x = b;
    if (solver.factor(domains, dofs, plain(variant)) != SolveStatus::Ok ||
        solver.solve(x) != SolveStatus::Ok)
      return std::numeric_limits<double>::infinity();
    EXPECT_EQ(solver.report().num_multipliers, dofs.num_multipliers());
    worst = std::max(worst, relative_error(x, expected));
  }
  ::testing::Test::RecordProperty("error", std::to_string(worst));
  return worst;
}

double worst_error(const DecomposedCloth& cloth, const CornerOptions& corners = {}) {
  return worst_error(cloth.matrices(), cloth.K(), corners);
}

class Topologies : public ::testing::TestWithParam<int> {};

model::ClothModel cloth_of(const mesh::TriangleMesh& mesh, bool bending) {
  return testing::cloth_model(mesh,
                              testing::cotton(bending ? std::optional(7.014e-6) : std::nullopt));
}

TEST_P(Topologies, MatchTheUndividedSolve) {
  const int domains = GetParam();
  const mesh::TriangleMesh meshes[] = {testing::grid_mesh(21, 18), testing::sphere_mesh(3),
                                       tube_mesh(14, 20)};
  for (const mesh::TriangleMesh& mesh : meshes)
    for (const bool bending : {false, true})
      for (const double fraction : {0.0, 0.3, 0.5, 1.0}) {
        SCOPED_TRACE(::testing::Message() << mesh.num_vertices() << " vertices, bending " << bending
                                          << ", fraction " << fraction);
        const DecomposedCloth cloth = decompose_cloth(cloth_of(mesh, bending), domains);
        ASSERT_EQ(cloth.num_domains, domains);
        const InterfaceDofs dofs =
            classify_dofs(cloth.matrices(), mesh.num_vertices(), {.corner_fraction = fraction});
        EXPECT_EQ(dofs.num_multipliers() > 0, domains > 1 && fraction < 1);
        EXPECT_EQ(dofs.num_corners() > 0, domains > 1);
        EXPECT_LT(worst_error(cloth, {.corner_fraction = fraction}), 1e-11);
      }
}

INSTANTIATE_TEST_SUITE_P(PrimalDual, Topologies, ::testing::Values(1, 2, 3, 4, 7, 16, 64));

TEST(PrimalDual, RandomTriangleOwners) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const DecomposedCloth cloth = random_cloth(17, 6, seed);
    EXPECT_GT(classify_dofs(cloth.matrices(), 289).num_corners(), 200);
    EXPECT_LT(worst_error(cloth), 1e-11);
  }
}

TEST(PrimalDual, ClosedMeshWithoutCorners) {
  model::ClothModel model = cloth_of(testing::sphere_mesh(2), true);
  std::vector<int> owner;
  for (const Triangle& t : model.triangles) {
    double height = 0;
    for (const int v : t) height += model.start(v, 1);
    owner.push_back(height > 0);
  }
  const DecomposedCloth cloth = assign_triangles(model, owner, 2);
  constexpr CornerOptions kNone{.floating_corners = 0};
  EXPECT_EQ(classify_dofs(cloth.matrices(), 66, kNone).num_corners(), 0);
  EXPECT_GT(classify_dofs(cloth.matrices(), 66, kNone).num_multipliers(), 0);
  EXPECT_LT(worst_error(cloth, kNone), 1e-9);
  EXPECT_LT(worst_error(cloth), 1e-11);
}

TEST(PrimalDual, DomainsThatTouchInOneVertex) {
  mesh::TriangleMesh mesh;  // a bow tie
  mesh.positions.resize(5, 3);
  mesh.positions << 0, 0, 0, 1, 0, 1, 1, 0, -1, -1, 0, 1, -1, 0, -1;
  mesh.triangles = {{0, 1, 2}, {0, 4, 3}};
  const DecomposedCloth cloth = assign_triangles(cloth_of(mesh, false), {0, 1}, 2);
  constexpr CornerOptions kNone{.floating_corners = 0};
  EXPECT_EQ(classify_dofs(cloth.matrices(), 5, kNone).num_multipliers(), 1);
  EXPECT_LT(worst_error(cloth, kNone), 1e-12);
  EXPECT_EQ(classify_dofs(cloth.matrices(), 5).num_multipliers(), 0);
  EXPECT_LT(worst_error(cloth), 1e-12);
}

TEST(PrimalDual, CheckerboardOfTwoDomains) {
  std::vector<int> owner;
  for (int cell = 0; cell < 36; ++cell) owner.insert(owner.end(), 2, (cell / 6 + cell % 6) % 2);
  const DecomposedCloth cloth = assign_triangles(grid_cloth(7, 7, std::nullopt), owner, 2);
  EXPECT_LT(worst_error(cloth), 1e-12);
  EXPECT_LT(worst_error(cloth, {.floating_corners = 0}), 1e-9);
}

TEST(PrimalDual, ComponentsAndDomainsInSeveralPieces) {
  const auto mesh = testing::disjoint_union(testing::grid_mesh(9, 8), testing::sphere_mesh(2));
  const DecomposedCloth cloth = decompose_cloth(cloth_of(mesh, true), 6);
  EXPECT_LT(worst_error(cloth), 1e-11);
  std::vector<int> owner = cloth.triangle_domain;
  for (int& domain : owner) domain %= 2;
  EXPECT_LT(worst_error(assign_triangles(cloth.model, owner, 2)), 1e-11);
}

TEST(PrimalDual, IsolatedVerticesAndEmptyDomains) {
  DecomposedCloth cloth = slab_cloth(6, 7, 2);
  cloth.num_domains = 4;  // two without anything
  cloth.model.mass.conservativeResize(44);
  cloth.model.mass.tail(2).setConstant(0.01);
  cloth.vertex_domains.begin.resize(45, cloth.vertex_domains.begin.back());
  EXPECT_LT(worst_error(cloth), 1e-12);
}

// One triangle per domain: no internal vertices anywhere, 512 domains.
TEST(PrimalDual, DomainsWithoutInternalVertices) {
  const DecomposedCloth cloth = [] {
    model::ClothModel model = grid_cloth(17, 17);
    std::vector<int> owner(model.triangles.size());
    for (std::size_t t = 0; t < owner.size(); ++t) owner[t] = static_cast<int>(t);
    return assign_triangles(model, owner, 512);
  }();
  const InterfaceDofs dofs = classify_dofs(cloth.matrices(), 289);
  for (const DomainDofs& domain : dofs.domains) EXPECT_LE(domain.num_internal, 1);
  EXPECT_LT(worst_error(cloth), 1e-12);
}

TEST(PrimalDual, ManyDomains) {
  EXPECT_LT(worst_error(decompose_cloth(grid_cloth(41, 41), 512)), 1e-11);
}

TEST(PrimalDual, EmptyMatrix) {
  PrimalDual solver;
  RightHandSides none(0, 3);
  for (const Variant& variant : kVariants) {
    ASSERT_EQ(solver.factor({}, classify_dofs({}, 0), plain(variant)), SolveStatus::Ok);
    EXPECT_EQ(solver.solve(none), SolveStatus::Ok);
    const std::vector<DomainMatrix> empty(3);
    ASSERT_EQ(solver.factor(empty, classify_dofs(empty, 0)), SolveStatus::Ok);
    EXPECT_EQ(solver.solve(none), SolveStatus::Ok);
    EXPECT_EQ(solver.refactor(empty), SolveStatus::Ok);
  }
}

TEST(PrimalDual, PinnedVerticesAreEliminatedBeforehand) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(12, 12), 5);
  std::vector<char> fixed(144, 0);
  for (int i = 0; i < 12; ++i) fixed[static_cast<std::size_t>(i)] = 1;
  const model::FreeVertices free(fixed);
  EXPECT_LT(worst_error(model::restrict_to_free(cloth.matrices(), free),
                        model::restrict_to_free(cloth.K(), free)),
            1e-11);
}

// Shares made by algebra alone: definite for a diagonally dominant matrix, whatever the partition.
TEST(PrimalDual, AlgebraicShares) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(15, 15), 6);
  SparseMatrix K = cloth.K();
  for (int i = 0; i < K.rows(); ++i) {
    double sum = 0;
    for (SparseMatrix::InnerIterator it(K, i); it; ++it) sum += std::abs(it.value());
    K.coeffRef(i, i) = 1.1 * sum;
  }
  EXPECT_LT(worst_error(split_matrix(K, cloth.row_domains(), 6), K), 1e-12);
  // Shares of K as it is: indefinite blocks are a status, everything primal always works.
  const auto shares = split_matrix(cloth.K(), cloth.row_domains(), 6);
  EXPECT_LT(worst_error(shares, cloth.K(), {.corner_fraction = 1}), 1e-11);
}

TEST(PrimalDual, IndefiniteShareOfADefiniteMatrixIsAStatus) {
  DecomposedCloth cloth = slab_cloth(5, 5, 2, std::nullopt);
  auto domains = cloth.matrices();
  constexpr CornerOptions kNone{.floating_corners = 0};
  const InterfaceDofs dofs = classify_dofs(domains, 25, kNone);
  const DofCopy* copy = dofs.duplicate_copies[2].data();
  const int row = dofs.duplicate_rows[2];
  for (int side = 0; side < 2; ++side) {  // moves diagonal from one share to the other
    DomainMatrix& domain = domains[static_cast<std::size_t>(copy[side].domain)];
    const auto place = std::lower_bound(domain.rows.begin(), domain.rows.end(), row);
    const auto local = static_cast<Eigen::Index>(place - domain.rows.begin());
    domain.K.coeffRef(local, local) += side == 0 ? 1e6 : -1e6;
  }
  CholmodSolver whole;
  EXPECT_EQ(whole.factor(sum_matrices(domains, 25)), SolveStatus::Ok);
  for (const Variant& variant : kVariants)
    EXPECT_EQ(PrimalDual().factor(domains, dofs, plain(variant)), SolveStatus::NotPositiveDefinite);
}

// Half of the cloth is a million times stiffer, and nothing but mass holds the domains.
DecomposedCloth contrast_cloth(double contrast) {
  DecomposedCloth cloth = slab_cloth(20, 20, 4);
  for (std::size_t t = 0; t < cloth.model.stretch.size(); ++t)
    if (cloth.model.stretch[t].vertices[0] % 20 < 10) cloth.model.stretch[t].weight *= contrast;
  return cloth;
}

// Corners that hold stiff and soft parts together are where the dual form loses digits.
TEST(PrimalDual, RefinementRepairsStiffnessContrasts) {
  for (const double contrast : {1e6, 1e9}) {
    const DecomposedCloth cloth = contrast_cloth(contrast);
    const auto domains = cloth.matrices();
    const SparseMatrix K = cloth.K();
    const InterfaceDofs dofs = classify_dofs(domains, 400);
    ASSERT_GT(dofs.num_multipliers(), 0);
    ASSERT_GT(dofs.num_corners(), 0);
    const RightHandSides b = testing::random_positions(400, 1, 5);
    const RightHandSides expected = undivided_solve(K, b);
    for (const Variant& variant : kVariants) {
      SCOPED_TRACE(::testing::Message() << contrast << " " << static_cast<int>(variant.form));
      PrimalDual solver;
      PrimalDualOptions options = plain(variant);
      options.max_refinements = 3;
      options.refine_tolerance = 5e-15;
      RightHandSides x = b;
      ASSERT_EQ(solver.factor(domains, dofs, options), SolveStatus::Ok);
      ASSERT_EQ(solver.solve(x), SolveStatus::Ok);
      const PrimalDualTimes& times = solver.last_times();
      EXPECT_GT(times.first_error, 5e-15);
      EXPECT_GE(times.refinements, 1);
      EXPECT_LE(times.refinements, 3);
      EXPECT_LT(times.error, 5e-15);
      // No method does better than eps cond(K).
      EXPECT_LT(relative_error(x, expected), contrast * 1e-15);
    }
  }
}

TEST(PrimalDual, RefinementOnlyWhenAskedFor) {
  const DecomposedCloth cloth = contrast_cloth(1e3);
  const auto domains = cloth.matrices();
  const InterfaceDofs dofs = classify_dofs(domains, 400, {.floating_corners = 0});
  RightHandSides b = testing::random_positions(400, 1, 5);
  PrimalDual solver;
  ASSERT_EQ(solver.factor(domains, dofs, {.refine_tolerance = 1}), SolveStatus::Ok);
  ASSERT_EQ(solver.solve(b), SolveStatus::Ok);
  EXPECT_EQ(solver.last_times().refinements, 0);
  EXPECT_GT(solver.last_times().error, 0);
  constexpr double kNever = std::numeric_limits<double>::infinity();
  ASSERT_EQ(solver.factor(domains, dofs, {.refine_tolerance = kNever}), SolveStatus::Ok);
  ASSERT_EQ(solver.solve(b), SolveStatus::Ok);
  EXPECT_TRUE(std::isnan(solver.last_times().error));
}

TEST(PrimalDual, RightHandSidesOfZeroAndNan) {
  const DecomposedCloth cloth = slab_cloth(8, 8, 3);
  const auto domains = cloth.matrices();
  PrimalDual solver;
  ASSERT_EQ(solver.factor(domains, classify_dofs(domains, 64), {.refine_tolerance = 0}),
            SolveStatus::Ok);
  RightHandSides b = RightHandSides::Zero(64, 3);
  ASSERT_EQ(solver.solve(b), SolveStatus::Ok);
  EXPECT_TRUE(b == RightHandSides::Zero(64, 3));
  EXPECT_EQ(solver.last_times().error, 0);
  b(5, 1) = std::nan("");
  ASSERT_EQ(solver.solve(b), SolveStatus::Ok);
  EXPECT_TRUE(std::isnan(b(5, 1)));
  EXPECT_EQ(solver.last_times().refinements, 0);
}

TEST(PrimalDual, NearlyNoMass) {
  for (const double h : {1.0, 1e3}) {
    SCOPED_TRACE(h);
    const DecomposedCloth cloth = decompose_cloth(grid_cloth(14, 14), 5);
    const auto domains = cloth.matrices(h);
    const SparseMatrix K = cloth.K(h);
    const RightHandSides b = testing::random_positions(196, 1, 5);
    const RightHandSides expected = undivided_solve(K, b);
    for (const Variant& variant : kVariants) {
      PrimalDual solver;
      RightHandSides x = b;
      PrimalDualOptions options = plain(variant);
      options.max_refinements = 3;
      options.refine_tolerance = 1e-15;
      ASSERT_EQ(solver.factor(domains, classify_dofs(domains, 196), options), SolveStatus::Ok);
      ASSERT_EQ(solver.solve(x), SolveStatus::Ok);
      // cond(K) is about 1e7 h^2 / s^2 here; no method can do better than eps cond(K).
      EXPECT_LT(relative_error(x, expected), 1e-9 * std::max(1.0, h * h / 10));
      EXPECT_LT(solver.last_times().error, 1e-15);
    }
  }
}

/// Dense G of [Lu25, Eq. 8], straight from its definition.
struct DenseSystem {
  DenseSystem(std::span<const DomainMatrix> domains, const InterfaceDofs& dofs,
              const Eigen::MatrixXd& b) {
    const Eigen::Index multipliers = dofs.num_multipliers();
    const Eigen::Index corners = dofs.num_corners();
    G_RR = Eigen::MatrixXd::Zero(multipliers, multipliers);
    G_RC = Eigen::MatrixXd::Zero(multipliers, corners);
    G_CC = Eigen::MatrixXd::Zero(corners, corners);
    b_R = Eigen::MatrixXd::Zero(multipliers, 3);
    b_C = b(dofs.corner_rows, Eigen::all);
    for (std::size_t d = 0; d < domains.size(); ++d) {
      const DomainDofs& domain = dofs.domains[d];
      const Eigen::Index n_R = domain.num_remainder();
      std::vector<int> place(static_cast<std::size_t>(dofs.num_rows), -1);
      for (std::size_t i = 0; i < domains[d].rows.size(); ++i)
        place[static_cast<std::size_t>(domains[d].rows[i])] = static_cast<int>(i);
      std::vector<int> order;
      for (const int row : domain.rows) order.push_back(place[static_cast<std::size_t>(row)]);
      const Eigen::MatrixXd K = domains[d].K.toDense()(order, order);
      const Eigen::MatrixXd inverse = K.topLeftCorner(n_R, n_R).inverse();
      const Eigen::MatrixXd K_RC = K.topRightCorner(n_R, domain.num_corners);
      Eigen::MatrixXd S_D = Eigen::MatrixXd::Zero(multipliers, n_R);
      Eigen::MatrixXd b_d = b(domain.rows, Eigen::all).topRows(n_R);
      b_d.bottomRows(domain.num_duplicates) *= 0.5;
      for (int i = 0; i < domain.num_duplicates; ++i)
        S_D(domain.multiplier[static_cast<std::size_t>(i)], domain.num_internal + i) =
            domain.sign[static_cast<std::size_t>(i)];
      Eigen::MatrixXd S_C = Eigen::MatrixXd::Zero(domain.num_corners, corners);
      for (int i = 0; i < domain.num_corners; ++i)
        S_C(i, domain.corner[static_cast<std::size_t>(i)]) = 1;
      G_RR += S_D * inverse * S_D.transpose();
      G_RC += S_D * inverse * K_RC * S_C;
      G_CC += S_C.transpose() *
              (K.bottomRightCorner(domain.num_corners, domain.num_corners) -
               K_RC.transpose() * inverse * K_RC) *
              S_C;
      b_R += S_D * inverse * b_d;
      b_C -= S_C.transpose() * K_RC.transpose() * inverse * b_d;
    }
  }
  Eigen::MatrixXd G_RR, G_RC, G_CC, b_R, b_C;
};

// D13: what [Lu25] prints as Eq. 10 is not what follows from its Eq. 8.
TEST(PrimalDual, Equation10AsPrintedIsWrong) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(13, 13), 4);
  const auto domains = cloth.matrices();
  const InterfaceDofs dofs = classify_dofs(domains, 169);
  ASSERT_GT(dofs.num_multipliers(), 0);
  ASSERT_GT(dofs.num_corners(), 0);
  const RightHandSides b = testing::random_positions(169, 1, 5);
  const Eigen::MatrixXd expected = undivided_solve(cloth.K(), b)(dofs.corner_rows, Eigen::all);
  const DenseSystem s(domains, dofs, b);
  const Eigen::MatrixXd t = s.G_RR.inverse() * s.b_R;
  const Eigen::MatrixXd W = s.G_RR.inverse() * s.G_RC;

  const Eigen::MatrixXd corrected =
      (s.G_CC + s.G_RC.transpose() * W).inverse() * (s.b_C + s.G_RC.transpose() * t);
  EXPECT_LT((corrected - expected).norm() / expected.norm(), 1e-11);
  const Eigen::MatrixXd printed =
      (s.G_CC - s.G_RC.transpose() * s.G_RR * s.G_RC).inverse() * (s.b_C - s.G_RC.transpose() * t);
  EXPECT_GT((printed - expected).norm() / expected.norm(), 1e-2);
  const Eigen::MatrixXd only_inverse =
      (s.G_CC - s.G_RC.transpose() * W).inverse() * (s.b_C - s.G_RC.transpose() * t);
  EXPECT_GT((only_inverse - expected).norm() / expected.norm(), 1e-2);
}

TEST(PrimalDual, SameBitsForEveryNumberOfThreads) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(40, 40), 16);
  const auto domains = cloth.matrices();
  const InterfaceDofs dofs = classify_dofs(domains, 1600, {.corner_fraction = 0.3});
  for (const Variant& variant : kVariants) {
    const auto solve = [&] {
      PrimalDual solver;
      PrimalDualOptions options = plain(variant);
      options.max_refinements = 1;
      options.refine_tolerance = 0;
      RightHandSides x = testing::random_positions(1600, 1, 3);
      EXPECT_EQ(solver.factor(domains, dofs, options), SolveStatus::Ok);
      EXPECT_EQ(solver.solve(x), SolveStatus::Ok);
      EXPECT_EQ(solver.refactor(domains), SolveStatus::Ok);
      EXPECT_EQ(solver.solve(x), SolveStatus::Ok);
      return x;
    };
    const RightHandSides reference = ThreadPool(1).run(solve);
    for (const int threads : {2, 3, 8, 8})
      EXPECT_TRUE(ThreadPool(threads).run(solve) == reference) << threads << " threads";
  }
}

TEST(PrimalDual, RefactorsNewValues) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(14, 12), 5);
  const InterfaceDofs dofs = classify_dofs(cloth.matrices(), 168);
  const RightHandSides b = testing::random_positions(168, 1, 8);
  for (const Variant& variant : kVariants) {
    PrimalDual solver;
    EXPECT_EQ(solver.refactor(cloth.matrices()), SolveStatus::NotFactored);
    ASSERT_EQ(solver.factor(cloth.matrices(), dofs, plain(variant)), SolveStatus::Ok);
    for (const double h : {0.1, kStep}) {
      RightHandSides x = b;
      ASSERT_EQ(solver.refactor(cloth.matrices(h)), SolveStatus::Ok);
      EXPECT_EQ(solver.report().analyze_ms, 0);
      ASSERT_EQ(solver.solve(x), SolveStatus::Ok);
      EXPECT_LT(relative_error(x, undivided_solve(cloth.K(h), b)), 1e-10);
    }
    EXPECT_THROW(static_cast<void>(solver.refactor(decompose_cloth(cloth.model, 3).matrices())),
                 InputError);
    auto other_pattern = cloth.matrices();
    other_pattern[0].K.prune([](int row, int column, double) { return row == column; });
    EXPECT_THROW(static_cast<void>(solver.refactor(other_pattern)), InputError);
    RightHandSides x = b;
    EXPECT_EQ(solver.solve(x), SolveStatus::Ok);  // refused input leaves the factor
  }
}

/// Every variant refuses the bad matrices, drops its factor and leaves the right-hand side alone.
void expect_not_positive_definite(std::span<const DomainMatrix> good,
                                  std::span<const DomainMatrix> bad,
                                  const CornerOptions& corners = {}) {
  int n = 0;
  for (const DomainMatrix& domain : good) n = std::max(n, domain.rows.back() + 1);
  const InterfaceDofs dofs = classify_dofs(good, n, corners);
  for (const Variant& variant : kVariants) {
    SCOPED_TRACE(::testing::Message()
                 << static_cast<int>(variant.form) << " " << static_cast<int>(variant.interface));
    PrimalDual solver;
    ASSERT_EQ(solver.factor(good, dofs, plain(variant)), SolveStatus::Ok);
    EXPECT_EQ(solver.refactor(bad), SolveStatus::NotPositiveDefinite);
    RightHandSides b = RightHandSides::Constant(n, 3, 42);
    EXPECT_EQ(solver.solve(b), SolveStatus::NotFactored);
    EXPECT_EQ(solver.refactor(good), SolveStatus::Ok);
    EXPECT_EQ(solver.factor(bad, dofs, plain(variant)), SolveStatus::NotPositiveDefinite);
    EXPECT_EQ(solver.solve(b), SolveStatus::NotFactored);
    EXPECT_TRUE(b == RightHandSides::Constant(n, 3, 42));
    EXPECT_EQ(solver.factor(good, dofs, plain(variant)), SolveStatus::Ok);
    EXPECT_EQ(solver.solve(b), SolveStatus::Ok);
  }
}

TEST(PrimalDual, NanAndInfinityAreNotPositiveDefinite) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(9, 9), 4);
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    for (const int place : {0, 40, 150}) {
      auto bad = cloth.matrices();
      bad[1].K.valuePtr()[place] = value;
      expect_not_positive_definite(cloth.matrices(), bad);
    }
}

// A negative mass at an internal row shows in a domain, at a corner only in the corner matrix.
TEST(PrimalDual, IndefiniteMatricesAreAStatus) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(9, 9), 4);
  const InterfaceDofs dofs = classify_dofs(cloth.matrices(), 81);
  for (const int row : {dofs.domains[2].rows[0], dofs.corner_rows[0]}) {
    DecomposedCloth bad = cloth;
    bad.model.mass[row] = -50;
    expect_not_positive_definite(cloth.matrices(), bad.matrices());
  }
}

// Constants are the null space: with corners everywhere the corner matrix is singular, no domain.
TEST(PrimalDual, SingularMatricesAreAStatus) {
  for (const int rows : {13, 60}) {
    const DecomposedCloth cloth = slab_cloth(rows - 4, rows, 3);
    const auto good = split_matrix(integer_matrix(cloth, 1e-6), cloth.row_domains(), 3);
    const auto bad = split_matrix(integer_matrix(cloth, 0), cloth.row_domains(), 3);
    expect_not_positive_definite(good, bad, {.corner_fraction = 1});
  }
  const DecomposedCloth cloth = slab_cloth(9, 13, 3);
  DecomposedCloth nothing = cloth;
  for (auto& stretch : nothing.model.stretch) stretch.weight = 0;
  for (auto& bend : nothing.model.bend) bend.weight = 0;
  nothing.model.mass.setZero();
  expect_not_positive_definite(cloth.matrices(), nothing.matrices());
  expect_not_positive_definite(cloth.matrices(), nothing.matrices(), {.corner_fraction = 1});
}

// A dual interface with a singular whole, shares made by constraints of integer weight: a chain of
// springs of stiffness 1 without mass, one domain per half. The halves' own corner holds them.
TEST(PrimalDual, SingularWholeWithRegularDomains) {
  const auto ladder = [](double diagonal) {  // two rows of n vertices, springs between neighbours
    constexpr int kHalf = 8;
    std::vector<DomainMatrix> domains(2);
    for (int d = 0; d < 2; ++d) {
      const int columns = kHalf + 1;
      Eigen::MatrixXd K = Eigen::MatrixXd::Identity(2 * columns, 2 * columns) * diagonal;
      const auto spring = [&](int a, int b) {
        K(a, a) += 1;
        K(b, b) += 1;
        K(a, b) -= 1;
        K(b, a) -= 1;
      };
      for (int i = 0; i < columns; ++i) {
        domains[static_cast<std::size_t>(d)].rows.push_back(2 * (i + kHalf * d));
        domains[static_cast<std::size_t>(d)].rows.push_back(2 * (i + kHalf * d) + 1);
        spring(2 * i, 2 * i + 1);
        if (i + 1 == columns) continue;
        spring(2 * i, 2 * i + 2);
        spring(2 * i + 1, 2 * i + 3);
      }
      domains[static_cast<std::size_t>(d)].K = K.sparseView();
    }
    return domains;
  };
  auto good = ladder(1e-6);
  auto bad = ladder(0);
  const InterfaceDofs dofs = classify_dofs(good, 34, {.floating_corners = 1});
  EXPECT_EQ(dofs.num_multipliers(), 1);
  EXPECT_EQ(dofs.num_corners(), 1);
  expect_not_positive_definite(good, bad, {.floating_corners = 1});
  // Without the corner each half is singular by itself.
  expect_not_positive_definite(good, bad, {.floating_corners = 0});
}

TEST(PrimalDual, BeforeTheFirstFactor) {
  PrimalDual solver;
  RightHandSides b = RightHandSides::Ones(4, 3);
  EXPECT_EQ(solver.solve(b), SolveStatus::NotFactored);
  EXPECT_TRUE(b == RightHandSides::Ones(4, 3));
}

TEST(PrimalDual, RefusesAbsurdSizesByName) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(20, 20), 8);
  const auto domains = cloth.matrices();
  const auto text = [&](double fraction, InterfaceKind kind, double max_bytes) {
    try {
      PrimalDual solver;
      EXPECT_EQ(solver.factor(domains, classify_dofs(domains, 400, {.corner_fraction = fraction}),
                              {.interface = kind, .max_interface_bytes = max_bytes}),
                SolveStatus::Ok);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const double multipliers = classify_dofs(domains, 400).num_multipliers();
  const double nearly_dense = 0.99 * 8 * multipliers * multipliers;
  EXPECT_EQ(text(0, InterfaceKind::Dense, 1e9), "");
  EXPECT_NE(text(0, InterfaceKind::Sparse, 1e3).find("stored by blocks"), std::string::npos);
  EXPECT_NE(text(0, InterfaceKind::Dense, nearly_dense).find("use the sparse interface"),
            std::string::npos);
  EXPECT_EQ(text(0, InterfaceKind::Sparse, nearly_dense), "");
  EXPECT_NE(text(1, InterfaceKind::Sparse, 1e4).find("lower corner_fraction"), std::string::npos);
}

TEST(PrimalDual, RefusesWhatDoesNotFit) {
  const DecomposedCloth cloth = slab_cloth(6, 6, 2);
  const auto domains = cloth.matrices();
  const InterfaceDofs dofs = classify_dofs(domains, 36);
  const InterfaceDofs other = classify_dofs(slab_cloth(6, 6, 3).matrices(), 36);
  PrimalDual solver;
  ASSERT_EQ(solver.factor(domains, dofs), SolveStatus::Ok);
  EXPECT_THROW(static_cast<void>(solver.factor(domains, other)), InputError);
  EXPECT_THROW(static_cast<void>(solver.factor(domains, dofs, {.max_interface_bytes = 10})),
               InputError);
  EXPECT_THROW(static_cast<void>(solver.factor(domains, dofs, {.refine_tolerance = -1})),
               InputError);
  EXPECT_THROW(static_cast<void>(solver.factor(domains, dofs, {.max_refinements = -1})),
               InputError);
  RightHandSides x = testing::random_positions(36, 1, 3);
  const RightHandSides expected = undivided_solve(cloth.K(), x);
  ASSERT_EQ(solver.solve(x), SolveStatus::Ok);  // the factor from before
  EXPECT_LT(relative_error(x, expected), 1e-12);
}

TEST(PrimalDual, ReportsSizesAndTimes) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(20, 20), 4);
  const auto domains = cloth.matrices();
  const InterfaceDofs dofs = classify_dofs(domains, 400);
  for (const Variant& variant : kVariants) {
    PrimalDual solver;
    ASSERT_EQ(solver.factor(domains, dofs, plain(variant)), SolveStatus::Ok);
    const PrimalDualReport& report = solver.report();
    EXPECT_EQ(report.num_domains, 4);
    EXPECT_EQ(report.num_multipliers, dofs.num_multipliers());
    EXPECT_EQ(report.num_corners, dofs.num_corners());
    EXPECT_GT(report.factor_ms, 0);
    EXPECT_GT(report.domain_nonzeros, 400);
    EXPECT_GT(report.domain_bytes, 400 * sizeof(double));
    EXPECT_GT(report.interface_nonzeros, dofs.num_multipliers());
    EXPECT_GT(report.interface_bytes, dofs.num_multipliers() * sizeof(double));
    EXPECT_TRUE(report.stores_w);
    RightHandSides x = testing::random_positions(400, 1, 3);
    ASSERT_EQ(solver.solve(x), SolveStatus::Ok);
    EXPECT_GT(solver.last_times().domains_ms, 0);
    EXPECT_GT(solver.last_times().interface_ms, 0);
  }
}

// With many corners W would be larger than the domains' factors: then two solves with G_RR.
TEST(InterfaceSystem, SameSolutionWithAndWithoutW) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(20, 20), 6);
  const auto domains = cloth.matrices();
  const InterfaceDofs dofs = classify_dofs(domains, 400, {.corner_fraction = 0.3});
  std::vector<DomainBlocks> blocks(domains.size());
  for (std::size_t d = 0; d < domains.size(); ++d) {
    const DomainDofs& domain = dofs.domains[d];
    std::vector<int> order;
    for (const int row : domain.rows)
      order.push_back(
          static_cast<int>(std::lower_bound(domains[d].rows.begin(), domains[d].rows.end(), row) -
                           domains[d].rows.begin()));
    const Eigen::MatrixXd K = domains[d].K.toDense()(order, order);
    auto form = make_dual_domain(DomainForm::Literal, reference_backend());
    ASSERT_EQ(form->analyze(K.sparseView(), domain), SolveStatus::Ok);
    ASSERT_EQ(form->factorize(K.sparseView(), blocks[d]), SolveStatus::Ok);
  }
  RightHandSides lambda[2];
  RightHandSides corners[2];
  for (const int with_w : {0, 1}) {
    InterfaceSystem system;
    ASSERT_EQ(system.factor(dofs, blocks, {.max_w_bytes = with_w * 1e9}), SolveStatus::Ok);
    EXPECT_EQ(system.stores_w(), with_w == 1);
    lambda[with_w] = testing::random_positions(dofs.num_multipliers(), 1, 3);
    corners[with_w] = testing::random_positions(dofs.num_corners(), 1, 4);
    ASSERT_EQ(system.solve(lambda[with_w], corners[with_w]), SolveStatus::Ok);
  }
  EXPECT_LT(relative_error(lambda[0], lambda[1]), 1e-11);
  EXPECT_LT(relative_error(corners[0], corners[1]), 1e-12);
}

}  // namespace
}  // namespace piecework::global
