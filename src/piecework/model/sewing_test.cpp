#include <piecework/model/sewing.hpp>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/pins.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/testing/patchwork.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::model {
namespace {

using Dense = Eigen::MatrixXd;

struct Sewn {
  std::vector<mesh::Stitch> stitches;
  ClothModel model;

  explicit Sewn(const std::vector<testing::Patch>& patches, double close_time = 0,
                const Material& material = testing::cotton(1e-3))
      : stitches(testing::geometric_stitches(patches)),
        model(testing::cloth_model(testing::patchwork(patches), material)) {
    for (mesh::Stitch& stitch : stitches) stitch.close_time = close_time;
    if (close_time > 0)  // open: the patches lie scattered
      model.start += testing::random_positions(model.num_vertices(), 0.05, 3);
    model.sewing = Sewing(
        mesh::resolve_seams(stitches, model.num_vertices(), testing::plain_names()), model.start);
  }
  /// Fixed flags as the integrator makes them.
  [[nodiscard]] std::vector<char> held(const std::vector<int>& vertices) const {
    std::vector<char> fixed(static_cast<std::size_t>(model.num_vertices()), 0);
    for (const int v : vertices) fixed[static_cast<std::size_t>(v)] = 1;
    model.sewing.mark_held(fixed);
    return fixed;
  }
};

/// argmin x^T K x / 2 - b^T x under C x = d and x_v = target_v for held v, by multipliers: shares
/// nothing with the elimination.
Dense solve_kkt(const Dense& K, const Dense& b, Dense C, Dense d, const std::vector<int>& held,
                const Dense& target) {
  const Eigen::Index n = K.rows();
  const Eigen::Index rows = C.rows();
  const auto all = rows + static_cast<Eigen::Index>(held.size());
  C.conservativeResize(all, n);
  d.conservativeResize(all, 3);
  for (std::size_t i = 0; i < held.size(); ++i) {
    C.row(rows + static_cast<Eigen::Index>(i)).setZero();
    C(rows + static_cast<Eigen::Index>(i), held[i]) = 1;
    d.row(rows + static_cast<Eigen::Index>(i)) = target.row(held[i]);
  }
  Dense saddle = Dense::Zero(n + all, n + all);
  Dense right(n + all, 3);
  const double scale = K.diagonal().mean();
  saddle.topLeftCorner(n, n) = K;
  saddle.bottomLeftCorner(all, n) = scale * C;
  saddle.topRightCorner(n, all) = scale * C.transpose();
  right << b, scale * d;
  return Eigen::FullPivLU<Dense>(saddle).solve(right).topRows(n);
}

/// The same by the reduction, in increment form from x.
Positions solve_reduced(const ClothModel& model, const SparseMatrix& K, const Positions& b,
                        const std::vector<char>& fixed, Positions x) {
  const Reduction reduction(model, fixed);
  const Positions gradient = K * x - b;
  Unknowns increment(reduction.count(), 3);
  for (int i = 0; i < reduction.count(); ++i) increment.row(i) = -reduction.row(gradient, i);
  increment = Dense(reduction.system(K)).ldlt().solve(Dense(increment));
  reduction.advance(increment, x);
  return x;
}

TEST(Sewing, NothingSewnAllocatesAndDoesNothing) {
  const Sewing none;
  Positions x = testing::random_positions(4, 1, 1);
  const Positions before = x;
  std::vector<char> fixed(4, 0);
  none.follow(1, x);
  none.fold(x);
  none.mark_held(fixed);
  EXPECT_TRUE(x == before);
  EXPECT_EQ(none.gap(x), 0);
  EXPECT_TRUE(none.folded(x, 2) == x.row(2));
}

TEST(Sewing, FollowsItsCarriersWhileClosing) {
  const Sewn sewn(testing::four_patches(), /*close_time=*/0.5);
  const Sewing& sewing = sewn.model.sewing;
  ASSERT_GT(sewing.map().num_slaves(), 25);
  Positions x = sewn.model.start;
  sewing.follow(0, x);
  EXPECT_LT((x - sewn.model.start).cwiseAbs().maxCoeff(), 1e-15) << "as it starts";
  const double open = sewing.gap(x);
  EXPECT_GT(open, 0.02);
  double last = open;
  for (const double time : {0.1, 0.25, 0.4}) {
    sewing.follow(time, x);
    EXPECT_LT(sewing.gap(x), last);
    last = sewing.gap(x);
  }
  sewing.follow(0.25, x);
  EXPECT_NEAR(sewing.gap(x), open / 2, 1e-12) << "half way at half time";
  for (const double time : {0.5, 0.7}) {
    sewing.follow(time, x);
    EXPECT_EQ(sewing.gap(x), 0);
    // By the stitches themselves, not by T.
    const Dense C = testing::constraint_rows(sewn.stitches, sewn.model.num_vertices());
    EXPECT_LT((C * x).cwiseAbs().maxCoeff(), 1e-14);
  }
}

TEST(Sewing, FoldIsTheTransposedMapAndTheSameForEveryThreadCount) {
  const Sewn sewn(testing::four_patches());
  const int n = sewn.model.num_vertices();
  Dense T = Dense::Zero(n, n);
  for (int v = 0; v < n; ++v)
    sewn.model.sewing.map().visit_carriers(v, [&](int c, double w) { T(v, c) += w; });
  const Positions f = testing::random_positions(n, 1, 4);
  Positions folded = f;
  sewn.model.sewing.fold(folded);
  EXPECT_LT((folded - Positions(T.transpose() * f)).cwiseAbs().maxCoeff(), 1e-14);
  for (const int threads : {1, 2, 8}) {
    Positions again = f;
    ThreadPool(threads).run([&] { sewn.model.sewing.fold(again); });
    EXPECT_TRUE(again == folded) << threads;
  }
}

TEST(Reduction, WithoutSeamsIsTheRestrictionToTheBit) {
  const auto model = testing::cloth_model(testing::grid_mesh(7, 6), testing::cotton(1e-3));
  const SparseMatrix K = assemble_system(model, 0.01);
  std::vector<char> fixed(42, 0);
  fixed[0] = fixed[6] = fixed[20] = 1;
  const Reduction reduction(model, fixed);
  const FreeVertices free(fixed);
  const SparseMatrix expected = restrict_to_free(K, free);
  const SparseMatrix system = reduction.system(K);
  EXPECT_EQ(system.nonZeros(), expected.nonZeros());
  EXPECT_TRUE(Dense(system) == Dense(expected));
  const Positions f = testing::random_positions(42, 1, 5);
  for (int i = 0; i < reduction.count(); ++i)
    EXPECT_TRUE(reduction.row(f, i) == f.row(free.vertex[static_cast<std::size_t>(i)]));
}

TEST(Reduction, MatchesMultipliersOnFourPatches) {
  for (const double close_time : {0.0, 0.5}) {
    SCOPED_TRACE(close_time);
    const Sewn sewn(testing::four_patches(), close_time);
    const int n = sewn.model.num_vertices();
    const SparseMatrix K = assemble_system(sewn.model, 1.0 / 120);
    const Positions b = Positions(K * testing::random_positions(n, 1, 7));
    const Dense C = testing::constraint_rows(sewn.stitches, n);
    ASSERT_EQ(C.rows(), sewn.model.sewing.map().num_slaves());
    for (const std::vector<int>& held : {std::vector<int>{}, std::vector<int>{0, 12, 80}}) {
      SCOPED_TRACE(held.size());
      Positions x = sewn.model.start;
      sewn.model.sewing.follow(0.25, x);
      const double open = close_time > 0 ? 0.5 : 0;  // of the gaps, at half of close_time
      const Dense expected = solve_kkt(K, b, C, open * (C * sewn.model.start), held, x);
      const Positions found = solve_reduced(sewn.model, K, b, sewn.held(held), x);
      EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-10 * expected.cwiseAbs().maxCoeff());
      const Dense unsewn = Dense(K).ldlt().solve(Dense(b));
      EXPECT_GT((found - unsewn).cwiseAbs().maxCoeff(), 1e-3) << "the seams must matter";
    }
  }
}

/// Largest error of the elastic equilibrium under a linear displacement of the outer border.
double patch_test_error(const std::vector<testing::Patch>& patches) {
  const Sewn sewn(patches, 0, testing::cotton(std::nullopt));
  const int n = sewn.model.num_vertices();
  // No inertia to speak of: K is the elasticity alone.
  const SparseMatrix K = assemble_system(sewn.model, 1e8);
  Mat3 gradient;
  gradient << 1.2, 0.3, -0.1, 0.2, 0.7, 0.4, 0.5, -0.3, 1.1;
  const Positions linear = sewn.model.start * gradient;
  const Eigen::RowVector3d low = sewn.model.start.colwise().minCoeff();
  const Eigen::RowVector3d high = sewn.model.start.colwise().maxCoeff();
  std::vector<int> outer;
  for (int v = 0; v < n; ++v)
    for (const Eigen::Index axis : {0, 2})
      if ((std::abs(sewn.model.start(v, axis) - low[axis]) < 1e-12 ||
           std::abs(sewn.model.start(v, axis) - high[axis]) < 1e-12) &&
          !sewn.model.sewing.map().is_slave(v))
        outer.push_back(v);
  const std::vector<char> fixed = sewn.held(outer);
  Positions x = linear + testing::random_positions(n, 0.1, 9);
  for (const int v : outer) x.row(v) = linear.row(v);
  sewn.model.sewing.follow(1, x);
  x = solve_reduced(sewn.model, K, Positions::Zero(n, 3), fixed, x);
  EXPECT_LT(sewn.model.sewing.gap(x), 1e-13);
  return (x - linear).cwiseAbs().maxCoeff();
}

TEST(Reduction, NestedSeamsPassThePatchTest) {
  EXPECT_LT(patch_test_error({{0, 0, 1, 1, 5, 5}, {1, 0, 2, 1, 5, 5}}), 1e-12);   // conforming
  EXPECT_LT(patch_test_error({{0, 0, 1, 1, 5, 5}, {1, 0, 2, 1, 5, 9}}), 1e-12);   // 1 : 2
  EXPECT_LT(patch_test_error({{0, 0, 1, 1, 5, 5}, {1, 0, 2, 1, 5, 33}}), 1e-12);  // 1 : 8
}

// The error of non-nested seams is that of the trapezoid rule on the seam's tractions; the paper's
// rule, that the coarse side follows, is far worse even where nodes are nested. (D16)
TEST(Reduction, NonNestedSeamsPassWithinASmallErrorAndCoarseSlavesDoNot) {
  const double six_seven = patch_test_error({{0, 0, 1, 1, 7, 7}, {1, 0, 2, 1, 7, 8}});
  const double eight_twenty = patch_test_error({{0, 0, 1, 1, 9, 9}, {1, 0, 2, 1, 9, 21}});
  const double coarse_follows = patch_test_error({{0, 0, 1, 1, 5, 33}, {1, 0, 2, 1, 5, 5}});
  RecordProperty("six_seven", std::to_string(six_seven));
  RecordProperty("eight_twenty", std::to_string(eight_twenty));
  RecordProperty("coarse_follows", std::to_string(coarse_follows));
  EXPECT_GT(six_seven, 1e-6);
  EXPECT_LT(six_seven, 0.02);
  EXPECT_LT(eight_twenty, 0.01);
  EXPECT_GT(coarse_follows, 2 * six_seven);
}

TEST(Reduction, HeldSlavesHaveNoUnknownsAndPartlyHeldOnesMove) {
  const Sewn sewn({{0, 0, 1, 1, 3, 3}, {1, 0, 2, 1, 3, 5}});
  const mesh::SeamMap& map = sewn.model.sewing.map();
  EXPECT_EQ(map.slaves, (std::vector<int>{9, 12, 15, 18, 21}));
  const std::vector<char> fixed = sewn.held({2, 5});  // two of the three carriers
  EXPECT_TRUE(fixed[9] && fixed[12] && fixed[15]);
  EXPECT_FALSE(fixed[18] || fixed[21]);
  const Reduction reduction(sewn.model, fixed);
  EXPECT_EQ(reduction.count(), 9 + 15 - 5 - 2);
  Positions x = Positions::Zero(24, 3);
  Unknowns step = Unknowns::Zero(reduction.count(), 3);
  step.row(reduction.number(8)).setOnes();
  reduction.advance(step, x);
  EXPECT_EQ(x(18, 0), 0.5);
  EXPECT_EQ(x(21, 0), 1.0);
  EXPECT_EQ(x(15, 0), 0.0);
}

TEST(PinsOnCarriers, HoldWhatCarriesASlave) {
  const Sewn sewn({{0, 0, 1, 1, 3, 3}, {1, 0, 2, 1, 3, 5}});
  const PinNames names{[](std::size_t p) { return "pin " + std::to_string(p); },
                       [](int v) { return "vertex " + std::to_string(v); }};
  const mesh::SeamMap& map = sewn.model.sewing.map();
  const auto pins = pins_on_carriers({{.vertices = {12, 13}}, {.vertices = {0}}}, map, names);
  EXPECT_EQ(pins[0].vertices, (std::vector<int>{2, 5, 13}));
  EXPECT_EQ(pins[1].vertices, (std::vector<int>{0}));
  // Held by both sides in one way: fine. In two ways: refused.
  EXPECT_NO_THROW(pins_on_carriers({{.vertices = {12}}, {.vertices = {5}}}, map, names));
  try {
    pins_on_carriers({{.vertices = {5}}, {.vertices = {12}, .velocity = {1, 0, 0}}}, map, names);
    FAIL() << "two motions of one vertex";
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("pin 1: holds vertex 12, which is sewn onto vertex 5"), std::string::npos)
        << text;
    EXPECT_NE(text.find("pin 0"), std::string::npos) << text;
  }
  // Without seams pins keep their order, duplicates included.
  EXPECT_EQ(pins_on_carriers({{.vertices = {3, 1, 3}}}, {}, names)[0].vertices,
            (std::vector<int>{3, 1, 3}));
}

}  // namespace
}  // namespace piecework::model
