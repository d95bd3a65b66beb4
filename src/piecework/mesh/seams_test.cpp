#include <piecework/mesh/seams.hpp>

#include <algorithm>
#include <functional>
#include <numbers>
#include <numeric>
#include <set>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/mesh/topology.hpp>
#include <piecework/testing/patchwork.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::mesh {
namespace {

using testing::constraint_rows;
using testing::geometric_stitches;

SeamMap resolve(const std::vector<Stitch>& stitches, int num_vertices) {
  return resolve_seams(stitches, num_vertices, testing::plain_names());
}

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// Dense T with a zero column for each slave.
Eigen::MatrixXd dense_T(const SeamMap& map, int num_vertices) {
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(num_vertices, num_vertices);
  for (int v = 0; v < num_vertices; ++v)
    map.visit_carriers(v, [&](int c, double w) { T(v, c) += w; });
  return T;
}

/// What holds of every T: rows sum to one over free vertices, and every stitch is satisfied by
/// every x_free. With as many slaves as independent constraints it is all of their null space.
void expect_null_space(const std::vector<Stitch>& stitches, const SeamMap& map, int num_vertices) {
  const Eigen::MatrixXd T = dense_T(map, num_vertices);
  EXPECT_LT((T.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-14);
  for (const int c : map.carrier) EXPECT_FALSE(map.is_slave(c));
  const Eigen::MatrixXd C = constraint_rows(stitches, num_vertices);
  EXPECT_LT((C * T).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_EQ(map.num_slaves(), Eigen::FullPivLU<Eigen::MatrixXd>(C).rank());
  EXPECT_TRUE(std::is_sorted(map.slaves.begin(), map.slaves.end()));
}

SeamChain even_chain(int first, int count, double length) {
  SeamChain chain;
  for (int i = 0; i < count; ++i) {
    chain.vertices.push_back(first + i);
    chain.arc.push_back(length * i / (count - 1));
  }
  return chain;
}

TEST(SeamChains, FineSideFollowsAndNestedNodesCoincide) {
  const auto stitches = stitch_chains(even_chain(0, 3, 1), even_chain(10, 17, 1), "s");
  ASSERT_EQ(stitches.size(), 17U);
  for (std::size_t i = 0; i < 17; ++i) {
    const double place = stitches[i].a + stitches[i].ratio;  // coarse vertices 0, 1, 2
    EXPECT_EQ(stitches[i].vertex, 10 + static_cast<int>(i));
    EXPECT_NEAR(place, static_cast<double>(i) / 8, 1e-12);
    EXPECT_EQ(stitches[i].b, stitches[i].a + 1);
  }
  const SeamMap map = resolve(stitches, 27);
  EXPECT_EQ(map.num_slaves(), 17);
  expect_null_space(stitches, map, 27);
  EXPECT_EQ(stitch_chains(even_chain(10, 17, 1), even_chain(0, 3, 1), "s").front().vertex, 10);
}

TEST(SeamChains, EqualSidesMergeVertexByVertex) {
  const auto stitches = stitch_chains(even_chain(0, 6, 0.7), even_chain(6, 6, 0.7), "s");
  const SeamMap map = resolve(stitches, 12);
  EXPECT_EQ(map.slaves, (std::vector<int>{6, 7, 8, 9, 10, 11}));
  EXPECT_EQ(map.carrier, (std::vector<int>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(map.weight, std::vector<double>(6, 1.0)) << "snapped, not nearly";
}

TEST(SeamChains, ReversedChainsMeetEndToEnd) {
  SeamChain b = even_chain(3, 3, 1);
  std::reverse(b.vertices.begin(), b.vertices.end());
  const SeamMap map = resolve(stitch_chains(even_chain(0, 3, 1), b, "s"), 6);
  EXPECT_EQ(map.carrier, (std::vector<int>{2, 1, 0}));
}

TEST(SeamChains, LongerSideIsGatheredByFractionOfLength) {
  const auto stitches = stitch_chains(even_chain(0, 5, 2.0), even_chain(5, 9, 3.0), "s");
  for (std::size_t i = 0; i < 9; ++i)
    EXPECT_NEAR(stitches[i].a + stitches[i].ratio, static_cast<double>(i) / 2, 1e-12);
}

TEST(SeamChains, UnevenSpacingFollowsTheArc) {
  const SeamChain coarse{{0, 1, 2}, {0, 0.9, 1.0}};
  const auto stitches = stitch_chains(coarse, even_chain(3, 5, 1), "s");
  EXPECT_EQ(stitches[2].a, 0);
  EXPECT_NEAR(stitches[2].ratio, 0.5 / 0.9, 1e-14);
  EXPECT_EQ(stitches[4].b, 2);
  EXPECT_EQ(stitches[4].ratio, 1.0);
}

TEST(SeamChains, RefusesNonsense) {
  const SeamChain good = even_chain(0, 3, 1);
  EXPECT_NE(refusal([&] {
              stitch_chains(good, {{5}, {0}}, "hem");
            }).find("hem: a chain of 1"),
            std::string::npos);
  EXPECT_NE(refusal([&] { stitch_chains(good, {}, "hem"); }).find("of 0"), std::string::npos);
  EXPECT_NE(refusal([&] {
              stitch_chains(good, {{5, 6, 5, 7}, {0, 1, 2, 3}}, "hem");
            }).find("twice"),
            std::string::npos);
  EXPECT_NE(refusal([&] {
              stitch_chains(good, {{5, 6}, {0, 0}}, "hem");
            }).find("no length"),
            std::string::npos);
}

TEST(Seams, NothingSewnIsEmpty) {
  const SeamMap map = resolve({}, 5);
  EXPECT_TRUE(map.empty());
  EXPECT_TRUE(map.row.empty()) << "off allocates nothing";
  int visits = 0;
  map.visit_carriers(3, [&](int c, double w) {
    EXPECT_EQ(c, 3);
    EXPECT_EQ(w, 1.0);
    ++visits;
  });
  EXPECT_EQ(visits, 1);
}

TEST(Seams, ChainsOfSlavesAreSubstituted) {
  // 2 lies in the middle of 0 1; 3 in the middle of 2 1; 4 coincides with 3.
  const std::vector<Stitch> stitches = {{.vertex = 4, .a = 3, .b = 0, .ratio = 0},
                                        {.vertex = 3, .a = 2, .b = 1, .ratio = 0.5},
                                        {.vertex = 2, .a = 0, .b = 1, .ratio = 0.5}};
  const SeamMap map = resolve(stitches, 5);
  EXPECT_EQ(map.slaves, (std::vector<int>{2, 3, 4}));
  expect_null_space(stitches, map, 5);
  EXPECT_EQ(map.weight, (std::vector<double>{0.5, 0.5, 0.25, 0.75, 0.25, 0.75}));
}

TEST(Seams, FourCornersMeetInOneUnknown) {
  const std::vector<Stitch> ring = {{.vertex = 1, .a = 0, .b = 9, .ratio = 0},
                                    {.vertex = 2, .a = 9, .b = 1, .ratio = 1},
                                    {.vertex = 3, .a = 2, .b = 9, .ratio = 1e-12},
                                    {.vertex = 0, .a = 3, .b = 9, .ratio = 0}};  // closes the ring
  const SeamMap map = resolve(ring, 10);
  EXPECT_EQ(map.slaves, (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(map.carrier, (std::vector<int>{0, 0, 0}));
}

TEST(Seams, AnEdgeThatBecomesAPointMerges) {
  const SeamMap map = resolve(
      {{.vertex = 2, .a = 0, .b = 1, .ratio = 0.3}, {.vertex = 1, .a = 0, .b = 2, .ratio = 0}}, 3);
  EXPECT_EQ(map.slaves, (std::vector<int>{1, 2}));
  EXPECT_EQ(map.weight, (std::vector<double>{1, 1}));
}

TEST(Seams, DartOfOnePatchClosesOntoItself) {
  // Two legs from a common tip, 5 and 9 vertices, tip last.
  SeamChain a = even_chain(0, 5, 1);
  SeamChain b = even_chain(5, 9, 1);
  b.vertices.back() = a.vertices.back();
  const auto stitches = stitch_chains(a, b, "dart");
  const SeamMap map = resolve(stitches, 13);
  EXPECT_EQ(map.num_slaves(), 8) << "the tip itself is free";
  EXPECT_FALSE(map.is_slave(4));
  expect_null_space(stitches, map, 13);
}

TEST(Seams, ClosedSleeveOnAClosedArmhole) {
  SeamChain sleeve = even_chain(0, 13, 1);
  sleeve.vertices.back() = 0;
  SeamChain armhole = even_chain(12, 9, 1.1);
  armhole.vertices.back() = 12;
  const auto stitches = stitch_chains(sleeve, armhole, "armhole");
  const SeamMap map = resolve(stitches, 20);
  EXPECT_EQ(map.num_slaves(), 12);
  expect_null_space(stitches, map, 20);
}

TEST(Seams, FourPatchesWithTwoTJunctions) {
  const auto patches = testing::four_patches();
  const auto stitches = geometric_stitches(patches);
  const int n = testing::patchwork(patches).num_vertices();
  const SeamMap map = resolve(stitches, n);
  EXPECT_EQ(map.num_slaves(), static_cast<int>(stitches.size())) << "each vertex is sewn once";
  EXPECT_GT(map.num_slaves(), 25);
  expect_null_space(stitches, map, n);
}

TEST(Seams, AgreeingStitchesOfMergedVerticesAreOne) {
  // A T-junction told three times: both corners lie on the edge, and on each other.
  const std::vector<Stitch> stitches = {{.vertex = 2, .a = 0, .b = 1, .ratio = 0.3},
                                        {.vertex = 3, .a = 1, .b = 0, .ratio = 0.7},
                                        {.vertex = 2, .a = 3, .b = 0, .ratio = 0}};
  const SeamMap map = resolve(stitches, 4);
  EXPECT_EQ(map.num_slaves(), 2);
  expect_null_space(stitches, map, 4);
}

TEST(Seams, RefusalsNameSeamVertexAndRemedy) {
  const auto text = [](std::vector<Stitch> s) { return refusal([&] { resolve(s, 6); }); };
  const std::string twice = text({{.vertex = 4, .a = 0, .b = 1, .ratio = 0.5},
                                  {.vertex = 4, .a = 2, .b = 3, .ratio = 0.5, .seam = 1}});
  EXPECT_NE(twice.find("seam 1: vertex 4 is sewn onto two edges"), std::string::npos) << twice;
  EXPECT_NE(twice.find("by seam 0); remove one"), std::string::npos) << twice;
  const std::string cycle = text({{.vertex = 2, .a = 0, .b = 1, .ratio = 0.5},
                                  {.vertex = 1, .a = 2, .b = 3, .ratio = 0.5, .seam = 2}});
  EXPECT_NE(cycle.find("seam 2: vertex 1 hangs on itself"), std::string::npos) << cycle;
  EXPECT_NE(cycle.find("exchange the sides"), std::string::npos) << cycle;
  EXPECT_NE(text({{.vertex = 2, .a = 2, .b = 1, .ratio = 0.5}}).find("hangs on itself"),
            std::string::npos);
  EXPECT_NE(text({{.vertex = 6, .a = 2, .b = 1, .ratio = 0.5}}).find("vertex 6 does not exist"),
            std::string::npos);
  EXPECT_NE(text({{.vertex = 0, .a = -1, .b = 1, .ratio = 0}}).find("vertex -1"),
            std::string::npos);
  EXPECT_NE(text({{.vertex = 0, .a = 2, .b = 1, .ratio = 1.5}}).find("ratio 1.5"),
            std::string::npos);
  EXPECT_NE(text({{.vertex = 0, .a = 2, .b = 1, .ratio = std::nan("")}}).find("ratio nan"),
            std::string::npos);
}

TEST(Seams, YieldingStitchesLeaveContradictionsOut) {
  const SeamMap map = resolve({{.vertex = 4, .a = 2, .b = 3, .ratio = 0.5, .yields = true},
                               {.vertex = 1, .a = 4, .b = 3, .ratio = 0.5, .yields = true},
                               {.vertex = 4, .a = 0, .b = 1, .ratio = 0.5}},
                              6);
  EXPECT_EQ(map.slaves, (std::vector<int>{4}));
  EXPECT_EQ(map.carrier, (std::vector<int>{0, 1})) << "what was asked for goes first";
  EXPECT_EQ(map.dropped, 2);
}

TEST(Seams, AVertexClosesWithTheLastSeamItHangsOn) {
  const SeamMap map = resolve({{.vertex = 2, .a = 0, .b = 1, .ratio = 0.5, .close_time = 0.25},
                               {.vertex = 3, .a = 2, .b = 4, .ratio = 0.5},
                               {.vertex = 5, .a = 3, .b = 1, .ratio = 0, .close_time = 0.5},
                               {.vertex = 6, .a = 0, .b = 1, .ratio = 0}},
                              7);
  EXPECT_EQ(map.slaves, (std::vector<int>{2, 3, 5, 6}));
  EXPECT_EQ(map.close_time, (std::vector<double>{0.25, 0.5, 0.5, 0}));
}

TEST(Seams, LongChainsOfSlavesHangOnTheirEnd) {
  constexpr int kLinks = 1000;
  std::vector<Stitch> stitches;
  for (int v = 2; v < kLinks; ++v)
    stitches.push_back({.vertex = v, .a = v - 1, .b = 0, .ratio = 0.25});
  for (int round = 0; round < 2; ++round) {  // from either end
    const SeamMap map = resolve(stitches, kLinks);
    EXPECT_EQ(map.num_slaves(), kLinks - 2);
    EXPECT_EQ(map.carrier.size(), 2U * (kLinks - 2));
    EXPECT_NEAR(map.weight[5], std::pow(0.75, 3), 1e-15);
    std::reverse(stitches.begin(), stitches.end());
  }
}

std::vector<std::array<int, 2>> border_edges(const TriangleMesh& mesh, int first, int last) {
  std::vector<std::array<int, 2>> edges;
  for (const Edge& e : find_edges(mesh.triangles))
    if (e.triangles[1] < 0 && e.vertices[0] >= first && e.vertices[1] < last)
      edges.push_back(e.vertices);
  return edges;
}

TEST(SeamsByDistance, TwoPatchesFineOntoCoarseWhicheverIsNamedFirst) {
  const std::vector<testing::Patch> patches = {{0, 0, 1, 1, 5, 9}, {1, 0, 2, 1, 5, 4}};
  const TriangleMesh mesh = testing::patchwork(patches);
  const auto left = border_edges(mesh, 0, 45);
  const auto right = border_edges(mesh, 45, 65);
  for (const auto& stitches : {stitch_near(mesh.positions, left, right, 1e-6),
                               stitch_near(mesh.positions, right, left, 1e-6)}) {
    ASSERT_EQ(stitches.size(), 9U);
    for (const Stitch& s : stitches) {
      EXPECT_LT(s.vertex, 45) << "nine vertices follow four";
      EXPECT_GE(s.a, 45);
    }
    EXPECT_EQ(resolve(stitches, 65).num_slaves(), 9);
  }
}

TEST(SeamsByDistance, SewsOneMeshToItselfThroughTJunctions) {
  const TriangleMesh mesh = testing::patchwork(testing::four_patches());
  const auto edges = border_edges(mesh, 0, mesh.num_vertices());
  const SeamMap map = resolve(stitch_near(mesh.positions, edges, edges, 1e-6), mesh.num_vertices());
  // As many as geometry gives, but for the corners that carry what they would follow.
  const int all = static_cast<int>(geometric_stitches(testing::four_patches()).size());
  EXPECT_GE(map.num_slaves() + map.dropped, all - 3);
  EXPECT_LE(map.dropped, 2);
  // Positions are linear in themselves: straight seams keep every vertex where it is.
  const Positions x = dense_T(map, mesh.num_vertices()) * mesh.positions;
  EXPECT_LT((x - mesh.positions).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(SeamsByDistance, ADartIsSewnToItself) {
  // A disc without a slice of 20 degrees, folded into a cone: its two cut borders coincide.
  TriangleMesh mesh = testing::grid_mesh(7, 13);
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    const double radius = 0.2 + mesh.positions(v, 0);
    const double angle = 2 * std::numbers::pi * mesh.positions(v, 2);
    mesh.positions.row(v) << radius * std::cos(angle), radius, radius * std::sin(angle);
  }
  const auto edges = border_edges(mesh, 0, mesh.num_vertices());
  const SeamMap map = resolve(stitch_near(mesh.positions, edges, edges, 1e-6), mesh.num_vertices());
  EXPECT_EQ(map.num_slaves(), 7) << "the cut, vertex by vertex";
  EXPECT_EQ(map.weight, std::vector<double>(7, 1.0));
}

TEST(SeamsByDistance, FarBordersAreLeftAlone) {
  const std::vector<testing::Patch> patches = {{0, 0, 1, 1, 3, 3}, {1.1, 0, 2, 1, 3, 3}};
  const TriangleMesh mesh = testing::patchwork(patches);
  const auto left = border_edges(mesh, 0, 9);
  const auto right = border_edges(mesh, 9, 18);
  EXPECT_TRUE(stitch_near(mesh.positions, left, right, 0.05).empty());
  EXPECT_EQ(stitch_near(mesh.positions, left, right, 0.11).size(), 3U);
}

TEST(Seams, FindsTrianglesThatCollapse) {
  const TriangleMesh mesh = testing::grid_mesh(3, 3);
  const auto collapsed = [&](const Stitch& stitch) {
    return collapsed_triangles(mesh.triangles, resolve({stitch}, 9)).size();
  };
  EXPECT_TRUE(collapsed_triangles(mesh.triangles, {}).empty());
  EXPECT_EQ(collapsed({.vertex = 8, .a = 0, .b = 1, .ratio = 0}), 0U);
  EXPECT_EQ(collapsed({.vertex = 4, .a = 0, .b = 2, .ratio = 0.5}), 0U);
  EXPECT_EQ(collapsed({.vertex = 5, .a = 8, .b = 1, .ratio = 0}), 1U);  // a border edge
  EXPECT_EQ(collapsed({.vertex = 4, .a = 5, .b = 1, .ratio = 0}), 2U);  // an inner one
}

/// Brute force: triangles of different patches whose sides overlap by more than a point.
std::set<std::array<int, 2>> overlapping_sides(const TriangleMesh& mesh) {
  std::set<std::array<int, 2>> pairs;
  const auto edges = find_edges(mesh.triangles);
  for (const Edge& e : edges)
    for (const Edge& f : edges) {
      if (e.triangles[1] >= 0 || f.triangles[1] >= 0 || e.triangles[0] >= f.triangles[0]) continue;
      const Eigen::RowVector3d from = mesh.positions.row(e.vertices[0]);
      const Eigen::RowVector3d along = mesh.positions.row(e.vertices[1]) - from;
      double ratio[2];
      bool on_line = true;
      for (std::size_t k = 0; k < 2; ++k) {
        const Eigen::RowVector3d d = mesh.positions.row(f.vertices[k]) - from;
        ratio[k] = d.dot(along) / along.squaredNorm();
        on_line = on_line && (d - ratio[k] * along).norm() < 1e-9;
      }
      const double low = std::max(0.0, std::min(ratio[0], ratio[1]));
      const double high = std::min(1.0, std::max(ratio[0], ratio[1]));
      if (on_line && high - low > 1e-9) pairs.insert({e.triangles[0], f.triangles[0]});
    }
  return pairs;
}

TEST(SeamNeighbors, AreThoseWhoseSidesOverlap) {
  for (const int fine : {4, 7, 13}) {
    SCOPED_TRACE(fine);
    const std::vector<testing::Patch> patches = {{0, 0, 1, 1, 3, 4}, {1, 0, 2, 1, 3, fine}};
    const TriangleMesh mesh = testing::patchwork(patches);
    const SeamMap map = resolve(geometric_stitches(patches), mesh.num_vertices());
    const auto pairs = seam_neighbors(mesh.triangles, map);
    EXPECT_EQ(std::set(pairs.begin(), pairs.end()), overlapping_sides(mesh));
    EXPECT_GE(pairs.size(), 3U);
  }
}

TEST(SeamNeighbors, ConnectTheFourPatches) {
  const TriangleMesh mesh = testing::patchwork(testing::four_patches());
  const SeamMap map = resolve(geometric_stitches(testing::four_patches()), mesh.num_vertices());
  const auto pairs = seam_neighbors(mesh.triangles, map);
  std::vector<int> component;
  ASSERT_EQ(edge_components(mesh.triangles, find_edges(mesh.triangles), component), 4);
  std::set<std::array<int, 2>> joined;
  for (const auto& [s, t] : pairs)
    joined.insert({component[static_cast<std::size_t>(s)], component[static_cast<std::size_t>(t)]});
  const std::set<std::array<int, 2>> expected = {{0, 1}, {0, 2}, {1, 2}, {1, 3}, {2, 3}};
  EXPECT_EQ(joined, expected);
}

}  // namespace
}  // namespace piecework::mesh
