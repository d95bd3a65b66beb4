#include <piecework/contact/near_pairs.hpp>

#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>

#include "contact_test_util.hpp"

namespace piecework::contact {
namespace {

using collision::PairKind;
using collision::PairVertices;

constexpr double kReach = 0.05, kSlack = 0.04;

bool share_a_vertex(const PairVertices& v, int first_of_second) {
  for (int i = 0; i < first_of_second; ++i)
    for (int k = first_of_second; k < 4; ++k)
      if (v[static_cast<std::size_t>(i)] == v[static_cast<std::size_t>(k)]) return true;
  return false;
}

/// All pairs of a surface, by definition, that come within `reach` at x.
std::set<PairVertices> pairs_within(const collision::Surface& surface, const Points& x,
                                    double reach, PairKind kind) {
  std::set<PairVertices> found;
  const auto consider = [&](const PairVertices& v) {
    bool cloth = false, obstacle = false;
    for (const int k : v) (surface.is_cloth(k) ? cloth : obstacle) = true;
    if (!cloth || (!obstacle && !surface.self)) return;
    if (share_a_vertex(v, kind == PairKind::VertexTriangle ? 1 : 2)) return;
    if (collision::closest(kind, x(v)).distance_sq < reach * reach) found.insert(v);
  };
  if (kind == PairKind::VertexTriangle) {
    for (int v = 0; v < surface.num_vertices; ++v)
      for (const Triangle& t : surface.triangles) consider({v, t[0], t[1], t[2]});
  } else {
    for (std::size_t a = 0; a < surface.edges.size(); ++a)
      for (std::size_t b = a + 1; b < surface.edges.size(); ++b)
        consider(
            {surface.edges[a][0], surface.edges[a][1], surface.edges[b][0], surface.edges[b][1]});
  }
  return found;
}

std::set<PairVertices> of_kind(const PairList& list, PairKind kind) {
  std::set<PairVertices> pairs;
  for (const NearPair& pair : list.pairs)
    if (pair.kind == kind) {
      EXPECT_TRUE(pairs.insert(pair.vertices).second) << "listed twice";
    }
  return pairs;
}

/// How many pairs come within reach at x; all of them must be in the list.
std::size_t expect_complete(const PairList& list, const collision::Surface& surface,
                            const Points& x) {
  std::size_t count = 0;
  for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
    const auto listed = of_kind(list, kind), wanted = pairs_within(surface, x, kReach, kind);
    for (const PairVertices& v : wanted)
      EXPECT_TRUE(listed.contains(v)) << v[0] << ' ' << v[1] << ' ' << v[2] << ' ' << v[3];
    count += wanted.size();
  }
  return count;
}

struct Crowd {
  mesh::TriangleMesh cloth = stacked_sheets(2, 6, 0.06);
  mesh::TriangleMesh obstacle = testing::grid_mesh(4, 4, 1.1);
  NearPairs near;
  Positions x = cloth.positions + testing::random_positions(72, 0.03, 1);
  Positions obstacles = obstacle.positions;

  explicit Crowd(bool self)
      : near(collision::make_surface(cloth.triangles, 72, obstacle.triangles, 16, self), kReach,
             kSlack) {
    obstacles.col(1).array() -= 0.06;
    near.begin();
  }
  /// No vertex farther than `distance` from x.
  [[nodiscard]] Positions moved(double distance, std::uint64_t seed) const {
    Positions way = testing::random_positions(72, 1, seed);
    for (Eigen::Index v = 0; v < 72; ++v) way.row(v) *= distance / way.row(v).norm();
    return x + way;
  }
};

class WithAndWithoutSelf : public ::testing::TestWithParam<bool> {};

TEST_P(WithAndWithoutSelf, ListIsCompleteWhileNothingLeavesTheSlack) {
  Crowd crowd(GetParam());
  const Points start{crowd.x, crowd.obstacles};
  ASSERT_TRUE(crowd.near.cover(start, start));
  const PairList list = crowd.near.near(start);
  EXPECT_GT(expect_complete(list, crowd.near.surface(), start), 50U);
  std::size_t gained = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Positions there = crowd.moved(0.999 * kSlack, seed);
    const Points x{there, crowd.obstacles};
    EXPECT_TRUE(crowd.near.valid_at(x));
    (void)crowd.near.cover(x, x);
    gained += expect_complete(list, crowd.near.surface(), x);
  }
  EXPECT_GT(gained, 2000U);
}

TEST_P(WithAndWithoutSelf, CandidatesAreCompleteWithinTheWhereabouts) {
  Crowd crowd(GetParam());
  const Positions far = crowd.moved(0.3, 77);
  const Points from{crowd.x, crowd.obstacles}, to{far, crowd.obstacles};
  ASSERT_TRUE(crowd.near.cover(from, to));
  Random random(5);
  std::size_t found = 0;
  for (int trial = 0; trial < 10; ++trial) {
    Positions between = crowd.x;
    for (Eigen::Index v = 0; v < 72; ++v)
      between.row(v) += random.uniform() * (far - crowd.x).row(v);
    const Points x{between, crowd.obstacles};
    EXPECT_FALSE(crowd.near.cover(x, x)) << "it is within";
    found += expect_complete(crowd.near.candidates(), crowd.near.surface(), x);
    found += expect_complete(crowd.near.near(x), crowd.near.surface(), x);
  }
  EXPECT_GT(found, 1000U);
}

INSTANTIATE_TEST_SUITE_P(Cloth, WithAndWithoutSelf, ::testing::Bool());

TEST(NearPairs, AreListedAnewOnlyWhenSomethingLeavesTheSlack) {
  Crowd crowd(true);
  const Points start{crowd.x, crowd.obstacles};
  (void)crowd.near.cover(start, start);
  EXPECT_FALSE(crowd.near.valid_at(start)) << "none yet";
  (void)crowd.near.near(start);
  const int first = crowd.near.generation();
  (void)crowd.near.near(start);
  EXPECT_EQ(crowd.near.generation(), first);
  Positions beyond = crowd.x;
  beyond(17, 2) += 1.001 * kSlack;
  const Points x{beyond, crowd.obstacles};
  EXPECT_FALSE(crowd.near.valid_at(x));
  EXPECT_TRUE(crowd.near.cover(x, x)) << "outside of the whereabouts too";
  (void)expect_complete(crowd.near.near(x), crowd.near.surface(), x);
  EXPECT_GT(crowd.near.generation(), first);
}

TEST(NearPairs, ListHoldsItsOwnDistancesAndNothingFar) {
  Crowd crowd(true);
  const Points x{crowd.x, crowd.obstacles};
  (void)crowd.near.cover(x, x);
  const PairList& list = crowd.near.near(x);
  ASSERT_FALSE(list.pairs.empty());
  for (const NearPair& pair : list.pairs) {
    EXPECT_LT(pair.distance, kReach + 2 * kSlack);
    EXPECT_EQ(pair.distance,
              std::sqrt(collision::closest(pair.kind, x(pair.vertices)).distance_sq));
  }
}

}  // namespace
}  // namespace piecework::contact
