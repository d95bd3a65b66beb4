// Seams by multipliers against seams by elimination and against one dense solve, on everything that
// tailors do.

#include <numbers>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/core/parallel.hpp>
#include <piecework/global/cholmod_solver.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/pd/primal_dual_step.hpp>
#include <piecework/testing/patchwork.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::pd {
namespace {

using Dense = Eigen::MatrixXd;

constexpr double kH = 1.0 / 120.0;

struct Sewn {
  std::string name;
  model::ClothModel model;
  std::vector<std::array<int, 2>> neighbors;
  std::vector<int> held;

  Sewn(std::string what, const mesh::TriangleMesh& mesh, const std::vector<mesh::Stitch>& stitches,
       std::vector<int> pins, bool bending = true)
      : name(std::move(what)),
        model(testing::cloth_model(mesh,
                                   testing::cotton(bending ? std::optional(1e-3) : std::nullopt))),
        held(std::move(pins)) {
    model.sewing = model::Sewing(
        mesh::resolve_seams(stitches, model.num_vertices(), testing::plain_names()), model.start);
    neighbors = mesh::seam_neighbors(model.triangles, model.sewing.map());
  }
  [[nodiscard]] decomposition::Elements elements() const {
    return {model.triangles,      model.hinges,        model.hinge_bends,
            model.num_vertices(), &model.sewing.map(), neighbors};
  }
};

Sewn patches_of(const std::string& name, const std::vector<testing::Patch>& patches,
                std::vector<int> held, bool bending = true) {
  return {name, testing::patchwork(patches), testing::geometric_stitches(patches), std::move(held),
          bending};
}

/// Every `stride`-th of `count` vertices from `first`, arc length by number.
mesh::SeamChain chain(int first, int count, int stride) {
  mesh::SeamChain result;
  for (int i = 0; i < count; ++i) {
    result.vertices.push_back(first + i * stride);
    result.arc.push_back(i);
  }
  return result;
}

/// The end of a tube: closed.
mesh::SeamChain ring(int first, int around) {
  mesh::SeamChain result = chain(first, around, 1);
  result.vertices.push_back(first);
  result.arc.push_back(around);
  return result;
}

mesh::TriangleMesh tube(int around, int along) {
  mesh::TriangleMesh mesh = testing::grid_mesh(around + 1, along);  // for its size, then bent
  mesh.triangles.clear();
  mesh.positions.resize(static_cast<Eigen::Index>(around) * along, 3);
  for (int j = 0; j < along; ++j)
    for (int i = 0; i < around; ++i) {
      const double angle = 2 * std::numbers::pi * i / around;
      mesh.positions.row(j * around + i) << 0.2 * std::cos(angle), 0.1 * j, 0.2 * std::sin(angle);
      if (j + 1 == along) continue;
      const int a = j * around + i;
      const int b = j * around + (i + 1) % around;
      mesh.triangles.push_back({a, a + around, b});
      mesh.triangles.push_back({b, a + around, b + around});
    }
  return mesh;
}

std::vector<Sewn> everything() {
  std::vector<Sewn> all;
  const auto four = testing::four_patches();
  all.push_back(patches_of("T-junctions, pins on a slave's carriers", four, {0, 12, 78, 80}));
  all.push_back(patches_of("no pin, no bending", four, {}, /*bending=*/false));
  all.push_back(patches_of(
      "crossing of four",
      {{0, 0, .5, .5, 5, 6}, {.5, 0, 1, .5, 7, 4}, {0, .5, .5, 1, 6, 5}, {.5, .5, 1, 1, 4, 7}},
      {0}));
  all.push_back(patches_of("three that meet inside an edge",
                           {{0, 0, 1, .4, 4, 3}, {0, .4, .47, 1, 6, 6}, {.47, .4, 1, 1, 9, 8}},
                           {0, 3}));
  all.push_back(patches_of(
      "slaves of slaves",
      {{0, 0, 1, .3, 3, 3}, {0, .3, 1, .6, 6, 4}, {0, .3, 1, .6, 11, 4}, {0, .6, 1, 1, 8, 4}}, {}));
  all.push_back(
      patches_of("nested, 4 to 16 edges", {{0, 0, 1, 1, 5, 5}, {1, 0, 2, 1, 9, 17}}, {0}));
  const auto panels = testing::disjoint_union(testing::grid_mesh(5, 5), testing::grid_mesh(8, 6));
  all.emplace_back("both sides of an open seam held in part", panels,
                   mesh::stitch_chains(chain(20, 5, 1), chain(25, 8, 1), "seam"),
                   std::vector<int>{20, 21, 26});
  const auto gathers = testing::disjoint_union(testing::grid_mesh(6, 5), testing::grid_mesh(21, 4));
  all.emplace_back("gathers, 20 edges to 5", gathers,
                   mesh::stitch_chains(chain(24, 6, 1), chain(30, 21, 1), "seam"),
                   std::vector<int>{0, 5});
  const auto tubes = testing::disjoint_union(tube(7, 6), tube(12, 5));
  all.emplace_back("closed seam", tubes, mesh::stitch_chains(ring(35, 7), ring(42, 12), "seam"),
                   std::vector<int>{0, 1});
  all.emplace_back("dart", testing::grid_mesh(9, 6),
                   mesh::stitch_chains(chain(0, 9, 1), chain(0, 6, 9), "seam"),
                   std::vector<int>{53});
  all.emplace_back("cloth to itself, vertex to vertex", testing::grid_mesh(9, 8),
                   mesh::stitch_chains(chain(0, 8, 9), chain(8, 8, 9), "seam"),
                   std::vector<int>{4});
  return all;
}

struct Case {
  explicit Case(const Sewn& sewn) : fixed(static_cast<std::size_t>(sewn.model.num_vertices()), 0) {
    for (const int v : sewn.held) fixed[static_cast<std::size_t>(v)] = 1;
    sewn.model.sewing.mark_held(fixed);
    reduction = model::Reduction(sewn.model, fixed);
    const SparseMatrix all = model::assemble_system(sewn.model, kH);
    K = reduction.system(all);
    // A force on every vertex, slaves too: the dense solve has it as it is, the others folded.
    const Positions force = testing::random_positions(sewn.model.num_vertices(), 1, 3);
    b.resize(reduction.count(), 3);
    for (int i = 0; i < reduction.count(); ++i) b.row(i) = reduction.row(force, i);
    const std::vector<int>& slaves = sewn.model.sewing.map().slaves;
    Dense C = testing::constraint_rows(sewn.model.sewing.map());
    std::vector<int> rows;  // of slaves that can move
    std::vector<int> movable;
    for (std::size_t s = 0; s < slaves.size(); ++s)
      if (!fixed[static_cast<std::size_t>(slaves[s])]) rows.push_back(static_cast<int>(s));
    for (int v = 0; v < sewn.model.num_vertices(); ++v)
      if (!fixed[static_cast<std::size_t>(v)]) movable.push_back(v);
    const Dense x = testing::solve_with_multipliers(
        Dense(all)(movable, movable), Dense(force)(movable, Eigen::all), Dense(C(rows, movable)));
    multipliers.resize(reduction.count(), 3);
    for (std::size_t i = 0; i < movable.size(); ++i)
      if (const int number = reduction.number(movable[i]); number >= 0)
        multipliers.row(number) = x.row(static_cast<Eigen::Index>(i));
    elimination = b;
    const auto cholmod = global::make_cholmod_solver();
    EXPECT_EQ(cholmod->factor(K, reduction.vertices()), global::SolveStatus::Ok);
    EXPECT_EQ(cholmod->solve(elimination), global::SolveStatus::Ok);
  }
  std::vector<char> fixed;
  model::Reduction reduction;
  SparseMatrix K;
  global::RightHandSides b;
  global::RightHandSides multipliers;  ///< of one dense solve
  global::RightHandSides elimination;
};

double error(const global::RightHandSides& x, const global::RightHandSides& expected) {
  return (x - expected).cwiseAbs().maxCoeff() / expected.cwiseAbs().maxCoeff();
}

// One slave alone may bring both its carriers into a domain, which then is theirs by mass.
TEST(DualSeams, EliminationInSharesSolvesThemAll) {
  for (const Sewn& sewn : everything()) {
    const Case c(sewn);
    for (const int domains : {1, 2, 3, 8, 32}) {
      const auto decomposition = decomposition::decompose(sewn.elements(), {.domains = domains});
      for (const double fraction : {0.0, 0.5, 1.0}) {
        SCOPED_TRACE(sewn.name + ", " + std::to_string(domains) + " domains, fraction " +
                     std::to_string(fraction));
        const auto solver = make_primal_dual_solver(
            sewn.model, decomposition, kH,
            {.corner_fraction = fraction, .solver = {.max_refinements = 0}});
        global::RightHandSides x = c.b;
        ASSERT_EQ(solver->factor(c.K, c.reduction.vertices()), global::SolveStatus::Ok);
        ASSERT_EQ(solver->solve(x), global::SolveStatus::Ok);
        EXPECT_LT(error(x, c.elimination), 1e-10);
      }
    }
  }
}

TEST(DualSeams, EveryKindOfSeamAgreesWithEliminationAndMultipliers) {
  double worst = 0;
  for (const Sewn& sewn : everything()) {
    const Case c(sewn);
    ASSERT_GT(sewn.model.sewing.map().num_slaves(), 4) << sewn.name;
    ASSERT_LT(error(c.elimination, c.multipliers), 1e-10) << sewn.name;
    for (const int domains : {1, 2, 3, 8, 32}) {
      const auto decomposition = decomposition::decompose(sewn.elements(), {.domains = domains});
      for (const double fraction : {0.0, 0.5, 1.0})
        for (const auto form : {global::DomainForm::Literal, global::DomainForm::OneSweep}) {
          SCOPED_TRACE(sewn.name + ", " + std::to_string(domains) + " domains, fraction " +
                       std::to_string(fraction));
          const auto solver =
              make_primal_dual_solver(sewn.model, decomposition, kH,
                                      {.corner_fraction = fraction,
                                       .seams = SeamForm::Dual,
                                       .solver = {.form = form, .max_refinements = 0}});
          global::RightHandSides x = c.b;
          ASSERT_EQ(solver->factor(c.K, c.reduction.vertices()), global::SolveStatus::Ok);
          ASSERT_EQ(solver->solve(x), global::SolveStatus::Ok);
          EXPECT_LT(error(x, c.elimination), 1e-10);
          EXPECT_LT(error(x, c.multipliers), 1e-10);
          worst = std::max(worst, error(x, c.multipliers));
        }
    }
  }
  RecordProperty("error", ::testing::PrintToString(worst));
}

TEST(DualSeams, PinsMayComeAndGo) {
  Sewn sewn = patches_of("four", testing::four_patches(), {0, 12, 78, 80});
  const auto decomposition = decomposition::decompose(sewn.elements(), {.domains = 6});
  const auto solver =
      make_primal_dual_solver(sewn.model, decomposition, kH, {.seams = SeamForm::Dual});
  for (const std::vector<int>& held : {std::vector{0, 12, 78, 80}, std::vector{80},
                                       std::vector<int>{}, std::vector{78, 79, 80, 81, 82}}) {
    sewn.held = held;
    const Case c(sewn);
    global::RightHandSides x = c.b;
    ASSERT_EQ(solver->factor(c.K, c.reduction.vertices()), global::SolveStatus::Ok);
    ASSERT_EQ(solver->solve(x), global::SolveStatus::Ok);
    EXPECT_LT(error(x, c.multipliers), 1e-10);
  }
}

TEST(DualSeams, SameBitsForEveryNumberOfThreads) {
  const Sewn sewn = patches_of("four", testing::four_patches(), {0, 12});
  const Case c(sewn);
  const auto decomposition = decomposition::decompose(sewn.elements(), {.domains = 8});
  const auto solve = [&] {
    const auto solver =
        make_primal_dual_solver(sewn.model, decomposition, kH, {.seams = SeamForm::Dual});
    global::RightHandSides x = c.b;
    EXPECT_EQ(solver->factor(c.K, c.reduction.vertices()), global::SolveStatus::Ok);
    EXPECT_EQ(solver->solve(x), global::SolveStatus::Ok);
    return x;
  };
  const global::RightHandSides reference = ThreadPool(1).run(solve);
  for (const int threads : {2, 3, 8}) EXPECT_TRUE(ThreadPool(threads).run(solve) == reference);
}

TEST(DualSeams, WithoutSeamsItIsThePlainSolverToTheBit) {
  const auto model = testing::cloth_model(testing::grid_mesh(12, 12), testing::cotton(1e-3));
  const auto decomposition = decomposition::decompose(
      {model.triangles, model.hinges, model.hinge_bends, model.num_vertices()}, {.domains = 4});
  const model::Reduction reduction(model, std::vector<char>(144, 0));
  const SparseMatrix K = reduction.system(model::assemble_system(model, kH));
  global::RightHandSides x[2];
  std::string description[2];
  for (const auto seams : {SeamForm::Elimination, SeamForm::Dual}) {
    const auto i = static_cast<std::size_t>(seams);
    const auto solver = make_primal_dual_solver(model, decomposition, kH, {.seams = seams});
    x[i] = testing::random_positions(144, 1, 3);
    ASSERT_EQ(solver->factor(K, reduction.vertices()), global::SolveStatus::Ok);
    ASSERT_EQ(solver->solve(x[i]), global::SolveStatus::Ok);
    description[i] = solver->description();
  }
  EXPECT_TRUE(x[0] == x[1]);
  EXPECT_EQ(description[0], description[1]);
}

}  // namespace
}  // namespace piecework::pd
