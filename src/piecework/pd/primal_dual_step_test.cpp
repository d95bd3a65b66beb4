#include <piecework/pd/primal_dual_step.hpp>

#include <gtest/gtest.h>

#include <piecework/global/cholmod_solver.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/testing/patchwork.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::pd {
namespace {

constexpr double kH = 1.0 / 120.0;

/// Largest relative difference between the primal-dual solver and an undivided factor.
double difference(const model::ClothModel& model, const decomposition::Elements& elements,
                  const std::vector<int>& held, double corner_fraction) {
  const auto domains = decomposition::decompose(elements, {.domains = 6});
  std::vector<char> fixed(static_cast<std::size_t>(model.num_vertices()), 0);
  for (const int v : held) fixed[static_cast<std::size_t>(v)] = 1;
  const model::Reduction reduction(model, fixed);
  const SparseMatrix K = reduction.system(model::assemble_system(model, kH));
  const auto ours =
      make_primal_dual_solver(model, domains, kH, {.corner_fraction = corner_fraction});
  const auto oracle = global::make_cholmod_solver();
  EXPECT_EQ(ours->factor(K, reduction.vertices()), global::SolveStatus::Ok);
  EXPECT_EQ(oracle->factor(K, reduction.vertices()), global::SolveStatus::Ok);
  EXPECT_EQ(ours->description().find(" 0 multipliers") == std::string::npos, corner_fraction < 1);
  EXPECT_GT(ours->report().nonzeros, 0);
  EXPECT_GT(ours->report().bytes, 0U);
  global::RightHandSides x = testing::random_positions(reduction.count(), 1, 3);
  global::RightHandSides expected = x;
  EXPECT_EQ(ours->solve(x), global::SolveStatus::Ok);
  EXPECT_EQ(oracle->solve(expected), global::SolveStatus::Ok);
  return (x - expected).norm() / expected.norm();
}

TEST(PrimalDualStep, HeldVerticesAreEliminatedInEveryShare) {
  const auto model = testing::cloth_model(testing::grid_mesh(30, 30), {0.5, 2e4, 2e-2});
  const decomposition::Elements elements{model.triangles, model.hinges, model.hinge_bends,
                                         model.num_vertices()};
  for (const double corner_fraction : {0.0, 0.5, 1.0})
    EXPECT_LT(difference(model, elements, {0, 29, 430, 431, 432, 460}, corner_fraction), 1e-10);
}

TEST(PrimalDualStep, SlavesOfSeamsAreEliminatedInEveryShare) {
  const auto patches = testing::four_patches();
  auto model = testing::cloth_model(testing::patchwork(patches), {0.5, 2e4, 2e-2});
  model.sewing = model::Sewing(mesh::resolve_seams(testing::geometric_stitches(patches),
                                                   model.num_vertices(), testing::plain_names()),
                               model.start);
  ASSERT_GT(model.sewing.map().num_slaves(), 25);
  decomposition::Elements elements{model.triangles, model.hinges, model.hinge_bends,
                                   model.num_vertices()};
  elements.seams = &model.sewing.map();
  EXPECT_LT(difference(model, elements, {0, 12}, 0.5), 1e-10);
}

}  // namespace
}  // namespace piecework::pd
