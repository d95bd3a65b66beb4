#include <piecework/decomposition/decomposition.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/mesh/import.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::decomposition {
namespace {

struct Case {
  explicit Case(mesh::TriangleMesh m)
      : mesh(std::move(m)),
        hinges(mesh::find_hinges(mesh.triangles, mesh::find_edges(mesh.triangles))) {}
  [[nodiscard]] Elements elements() const {
    return {mesh.triangles, hinges, {}, mesh.num_vertices()};
  }
  [[nodiscard]] Decomposition decompose(int domains) const {
    return decomposition::decompose(elements(), {.domains = domains});
  }
  mesh::TriangleMesh mesh;
  std::vector<mesh::Hinge> hinges;
};

/// Brute force: is the set of triangles of `domain` connected through shared edges?
bool connected(const Case& c, const Decomposition& d, int domain) {
  std::vector<int> root(c.mesh.triangles.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int t) {
    while (root[static_cast<std::size_t>(t)] != t) t = root[static_cast<std::size_t>(t)];
    return t;
  };
  for (const mesh::Hinge& h : c.hinges)
    if (d.triangle_domain[static_cast<std::size_t>(h.triangles[0])] == domain &&
        d.triangle_domain[static_cast<std::size_t>(h.triangles[1])] == domain)
      root[static_cast<std::size_t>(find(h.triangles[0]))] = find(h.triangles[1]);
  std::set<int> roots;
  for (std::size_t t = 0; t < root.size(); ++t)
    if (d.triangle_domain[t] == domain) roots.insert(find(static_cast<int>(t)));
  return roots.size() == 1;
}

/// Brute force: the domains of each vertex, from the constraints.
std::vector<std::set<int>> domains_of_vertices(const Case& c, const Decomposition& d) {
  std::vector<std::set<int>> sets(static_cast<std::size_t>(c.mesh.num_vertices()));
  for (std::size_t t = 0; t < c.mesh.triangles.size(); ++t)
    for (const int v : c.mesh.triangles[t])
      sets[static_cast<std::size_t>(v)].insert(d.triangle_domain[t]);
  for (std::size_t h = 0; h < c.hinges.size(); ++h)
    for (const int v : c.hinges[h].vertices)
      sets[static_cast<std::size_t>(v)].insert(d.hinge_domain[h]);
  return sets;
}

bool is_ancestor_or_self(const Decomposition& d, int ancestor, int node) {
  for (; node >= 0; node = d.nodes[static_cast<std::size_t>(node)].parent)
    if (node == ancestor) return true;
  return false;
}

int leaf_of(const Decomposition& d, int domain) {
  for (std::size_t n = 0; n < d.nodes.size(); ++n)
    if (d.nodes[n].is_leaf() && d.nodes[n].first_domain == domain) return static_cast<int>(n);
  return -1;
}

void expect_sound(const Case& c, const Decomposition& d) {
  std::vector<int> size(static_cast<std::size_t>(d.num_domains), 0);
  for (const int domain : d.triangle_domain) {
    ASSERT_GE(domain, 0);
    ASSERT_LT(domain, d.num_domains);
    ++size[static_cast<std::size_t>(domain)];
  }
  for (const int s : size) EXPECT_GT(s, 0) << "empty domain";
  const auto sets = domains_of_vertices(c, d);
  for (int v = 0; v < c.mesh.num_vertices(); ++v) {
    const auto first =
        d.vertex_domains.item.begin() + d.vertex_domains.begin[static_cast<std::size_t>(v)];
    const auto last =
        d.vertex_domains.item.begin() + d.vertex_domains.begin[static_cast<std::size_t>(v) + 1];
    EXPECT_TRUE(std::equal(first, last, sets[static_cast<std::size_t>(v)].begin(),
                           sets[static_cast<std::size_t>(v)].end()));
  }
  // The elimination-tree property: a constraint's vertices lie on its leaf's path to the root.
  for (std::size_t h = 0; h < c.hinges.size(); ++h)
    for (const int v : c.hinges[h].vertices)
      ASSERT_TRUE(is_ancestor_or_self(d, d.vertex_node[static_cast<std::size_t>(v)],
                                      leaf_of(d, d.hinge_domain[h])));
  for (std::size_t t = 0; t < c.mesh.triangles.size(); ++t)
    for (const int v : c.mesh.triangles[t])
      ASSERT_TRUE(is_ancestor_or_self(d, d.vertex_node[static_cast<std::size_t>(v)],
                                      leaf_of(d, d.triangle_domain[t])));
}

TEST(Decomposition, GridsAreConnectedBalancedAndSound) {
  const Case grid(testing::grid_mesh(41, 41));
  for (const int domains : {2, 3, 7, 16, 32, 64}) {
    SCOPED_TRACE(domains);
    const Decomposition d = grid.decompose(domains);
    ASSERT_EQ(d.num_domains, domains);
    expect_sound(grid, d);
    for (int k = 0; k < domains; ++k) EXPECT_TRUE(connected(grid, d, k)) << k;
    const Summary s = summarize(d, grid.elements());
    EXPECT_LT(s.balance, 1.25);
    EXPECT_GT(s.boundary, s.corner);
    EXPECT_EQ(s.remainder + s.corner, 41 * 41);
    EXPECT_GT(s.edge_cut, 0);
  }
}

TEST(Decomposition, OneDomainIsTheWholeMeshWithoutMetis) {
  const Case grid(testing::grid_mesh(5, 5));
  const Decomposition d = grid.decompose(1);
  EXPECT_EQ(d.num_domains, 1);
  EXPECT_EQ(d.nodes.size(), 1U);
  const Summary s = summarize(d, grid.elements());
  EXPECT_EQ(s.corner, 0);
  EXPECT_EQ(s.boundary, 0);
  EXPECT_EQ(s.remainder, 25);
  EXPECT_EQ(s.edge_cut, 0);
  EXPECT_EQ(s.balance, 1.0);
}

TEST(Decomposition, AsManyDomainsAsTrianglesAndMore) {
  const Case grid(testing::grid_mesh(4, 4));  // 18 triangles
  const Decomposition d = grid.decompose(18);
  EXPECT_EQ(d.num_domains, 18);
  EXPECT_TRUE(d.notes.empty());
  expect_sound(grid, d);
  const Decomposition reduced = grid.decompose(1000);
  EXPECT_EQ(reduced.num_domains, 18);
  ASSERT_EQ(reduced.notes.size(), 1U);
  EXPECT_NE(reduced.notes[0].find("1000"), std::string::npos);
  EXPECT_EQ(reduced.triangle_domain, d.triangle_domain);
}

TEST(Decomposition, EveryCountFromOneToTheNumberOfTriangles) {
  const Case grid(testing::grid_mesh(6, 5));  // 40 triangles
  for (int domains = 1; domains <= 40; ++domains) {
    SCOPED_TRACE(domains);
    const Decomposition d = grid.decompose(domains);
    ASSERT_EQ(d.num_domains, domains);
    expect_sound(grid, d);
  }
}

TEST(Decomposition, SingleTriangle) {
  mesh::TriangleMesh one;
  one.positions = testing::random_positions(3, 1, 1);
  one.triangles = {{0, 1, 2}};
  const Decomposition d = Case(one).decompose(8);
  EXPECT_EQ(d.num_domains, 1);
  EXPECT_EQ(d.notes.size(), 1U);
}

TEST(Decomposition, ClosedMeshWithTwoDomainsHasNoCorner) {
  const Case sphere(testing::sphere_mesh(3));
  const Decomposition d = sphere.decompose(2);
  expect_sound(sphere, d);
  const Summary s = summarize(d, sphere.elements());
  EXPECT_EQ(s.corner, 0);
  EXPECT_GT(s.boundary, 0);
}

TEST(Decomposition, ComponentsAreSplitBeforeBisection) {
  const Case two(testing::disjoint_union(testing::grid_mesh(21, 21), testing::grid_mesh(11, 11)));
  const Decomposition d = two.decompose(5);
  expect_sound(two, d);
  for (int k = 0; k < 5; ++k) EXPECT_TRUE(connected(two, d, k));
  // 800 and 200 triangles: four domains and one.
  std::set<int> of_large;
  for (int t = 0; t < 800; ++t) of_large.insert(d.triangle_domain[static_cast<std::size_t>(t)]);
  EXPECT_EQ(of_large.size(), 4U);
  // The root joins the two components and owns no separator.
  EXPECT_EQ(std::count(d.vertex_node.begin(), d.vertex_node.end(), 0), 0);
}

TEST(Decomposition, ManyComponentsShareATreeWithoutSeparators) {
  for (const int components : {3, 4, 7}) {
    SCOPED_TRACE(components);
    mesh::TriangleMesh pieces = testing::grid_mesh(5, 5);
    for (int i = 1; i < components; ++i)
      pieces = testing::disjoint_union(pieces, testing::grid_mesh(4 + i, 5));
    const Case c(pieces);
    const Decomposition d = c.decompose(components);
    expect_sound(c, d);
    for (const int node : d.vertex_node)
      EXPECT_TRUE(d.nodes[static_cast<std::size_t>(node)].is_leaf()) << "nothing is shared";
    const Decomposition finer = c.decompose(3 * components);
    expect_sound(c, finer);
  }
}

TEST(Decomposition, MoreComponentsThanDomainsArePacked) {
  mesh::TriangleMesh pieces = testing::grid_mesh(5, 5);
  for (int i = 0; i < 4; ++i) pieces = testing::disjoint_union(pieces, testing::grid_mesh(5, 5));
  const Case five(pieces);
  const Decomposition d = five.decompose(2);
  EXPECT_EQ(d.num_domains, 2);
  EXPECT_EQ(d.notes.size(), 1U);
  expect_sound(five, d);
  EXPECT_EQ(summarize(d, five.elements()).boundary, 0);
}

/// A palm with five fingers: what is left of a grid without the gaps between the fingers.
mesh::TriangleMesh hand(int cells_per_finger) {
  const int cells = 9 * cells_per_finger;
  mesh::TriangleMesh mesh = testing::grid_mesh(cells + 1, cells + 1);
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    const Eigen::RowVector3d center =
        (mesh.positions.row(t[0]) + mesh.positions.row(t[1]) + mesh.positions.row(t[2])) / 3;
    return center.z() > 0.2 && static_cast<int>(9 * center.x()) % 2 == 1;
  });
  return mesh;
}

// METIS likes to give a side two ends of different limbs; putting them together again must not cost
// the balance. Few domains may be out of balance all the same: fingers cannot be halved lengthwise.
TEST(Decomposition, LimbsAreConnectedAndBalanced) {
  const auto expect_balanced = [](const Case& c, int domains, double balance) {
    SCOPED_TRACE(domains);
    const Decomposition d = c.decompose(domains);
    for (int k = 0; k < domains; ++k) EXPECT_TRUE(connected(c, d, k)) << k;
    EXPECT_LT(summarize(d, c.elements()).balance, balance);
  };
  for (const int domains : {8, 16}) expect_balanced(Case(hand(7)), domains, 1.3);
  const std::string body = std::string(PIECEWORK_SHARED_DATA) + "/colliders/Armadillo_15K.ply";
  if (!std::filesystem::exists(body)) return;
  const Case armadillo(mesh::import_mesh(body, {}).mesh);
  for (const int domains : {2, 3, 4, 8, 16, 64}) expect_balanced(armadillo, domains, 1.1);
}

TEST(Decomposition, IsAFunctionOfItsInputOnly) {
  const Case grid(testing::grid_mesh(41, 33));
  const Decomposition expected = ThreadPool(1).run([&] { return grid.decompose(24); });
  for (const int threads : {2, 3, 8}) {
    const Decomposition d = ThreadPool(threads).run([&] { return grid.decompose(24); });
    EXPECT_EQ(d.triangle_domain, expected.triangle_domain);
    EXPECT_EQ(d.vertex_node, expected.vertex_node);
    EXPECT_EQ(d.vertex_domains.item, expected.vertex_domains.item);
  }
}

TEST(Decomposition, WithoutBendingTheInterfaceIsOneVertexWide) {
  const Case grid(testing::grid_mesh(31, 31));
  std::vector<std::uint8_t> none(grid.hinges.size(), 0);
  Elements membrane = grid.elements();
  membrane.hinge_bends = none;
  const Summary thin = summarize(decompose(membrane, {.domains = 2}), membrane);
  const Summary wide = summarize(grid.decompose(2), grid.elements());
  EXPECT_GE(thin.boundary, 31);
  EXPECT_LE(thin.boundary, 45);
  EXPECT_GT(wide.boundary, thin.boundary);
}

TEST(Decomposition, AdjacentDomainsMatchBruteForce) {
  const Case grid(testing::grid_mesh(21, 21));
  const Decomposition d = grid.decompose(9);
  std::set<std::array<int, 2>> expected;
  for (std::size_t a = 0; a < grid.mesh.triangles.size(); ++a)
    for (std::size_t b = 0; b < grid.mesh.triangles.size(); ++b) {
      const auto& ta = grid.mesh.triangles[a];
      int shared = 0;
      for (const int v : grid.mesh.triangles[b]) shared += std::count(ta.begin(), ta.end(), v) > 0;
      if (shared == 2 && d.triangle_domain[a] < d.triangle_domain[b])
        expected.insert({d.triangle_domain[a], d.triangle_domain[b]});
    }
  const auto pairs = adjacent_domains(d, grid.hinges);
  EXPECT_EQ(std::set(pairs.begin(), pairs.end()), expected);
  EXPECT_GT(pairs.size(), 8U);
}

/// Constraints per domain over the mean, the work that weights share out.
std::vector<double> work_of_domains(const Case& c, const Decomposition& d) {
  std::vector<double> work(static_cast<std::size_t>(d.num_domains), 0);
  const auto per = static_cast<double>(c.mesh.triangles.size() + c.hinges.size()) / d.num_domains;
  for (const int domain : d.triangle_domain) work[static_cast<std::size_t>(domain)] += 1 / per;
  for (const mesh::Hinge& h : c.hinges)
    for (const int t : h.triangles)
      work[static_cast<std::size_t>(d.triangle_domain[static_cast<std::size_t>(t)])] += 0.5 / per;
  return work;
}

TEST(DomainWeights, SizesFollowThem) {
  const Case grid(testing::grid_mesh(101, 101));
  std::vector<double> hybrid(16, 1.0);
  std::fill(hybrid.begin() + 8, hybrid.end(), 0.55);
  for (const std::vector<double>& weights :
       {hybrid, {3, 1}, {1, 2, 3, 4, 5}, {1, 1, 1, 0.2, 0.2, 0.2, 0.2}, {0.25, 4, 1, 1}}) {
    const Decomposition d = decompose(
        grid.elements(), {.domains = static_cast<int>(weights.size()), .domain_weights = weights});
    ASSERT_EQ(static_cast<std::size_t>(d.num_domains), weights.size());
    expect_sound(grid, d);
    const double mean = std::accumulate(weights.begin(), weights.end(), 0.0) / d.num_domains;
    const std::vector<double> work = work_of_domains(grid, d);
    for (std::size_t k = 0; k < weights.size(); ++k) {
      EXPECT_TRUE(connected(grid, d, static_cast<int>(k)));
      EXPECT_NEAR(work[k] / (weights[k] / mean), 1.0, 0.05) << k << " of " << weights.size();
    }
  }
}

TEST(DomainWeights, EqualOnesGiveTheBitsOfNone) {
  const Case grid(testing::grid_mesh(31, 31));
  for (const int domains : {1, 5, 16, 5000}) {
    const std::vector<double> weights(static_cast<std::size_t>(domains), 0.3);
    const Decomposition none = grid.decompose(domains);
    const Decomposition equal =
        decompose(grid.elements(), {.domains = domains, .domain_weights = weights});
    EXPECT_EQ(equal.triangle_domain, none.triangle_domain);
    EXPECT_EQ(equal.hinge_domain, none.hinge_domain);
    EXPECT_EQ(equal.vertex_node, none.vertex_node);
  }
}

/// Two sheets, one with four times the triangles of the other.
Case two_sheets() {
  mesh::TriangleMesh mesh = testing::grid_mesh(41, 41);
  const mesh::TriangleMesh small = testing::grid_mesh(21, 21);
  const int offset = mesh.num_vertices();
  Positions all(offset + small.num_vertices(), 3);
  all << mesh.positions, small.positions;
  mesh.positions = all;
  for (const Triangle& t : small.triangles)
    mesh.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  return Case(std::move(mesh));
}

TEST(DomainWeights, ComponentsGetTheDomainsThatFit) {
  const Case sheets = two_sheets();
  const Decomposition d =
      decompose(sheets.elements(), {.domains = 6, .domain_weights = {1, 1, 1, 1, 0.5, 0.5}});
  expect_sound(sheets, d);
  for (std::size_t t = 0; t < 3200; ++t) EXPECT_LT(d.triangle_domain[t], 4);
  for (std::size_t t = 3200; t < 4000; ++t) EXPECT_GE(d.triangle_domain[t], 4);
  // More components than domains: whole components, the large one where the weight is.
  const Decomposition one = decompose(sheets.elements(), {.domains = 1, .domain_weights = {2}});
  EXPECT_EQ(one.num_domains, 1);
  // Every number of domains up to one per triangle, the last ones heavy.
  for (const int domains : {2, 3, 100, 3999, 4000}) {
    std::vector<double> weights(static_cast<std::size_t>(domains), 0.001);
    weights.back() = 1000;
    const Decomposition many =
        decompose(sheets.elements(), {.domains = domains, .domain_weights = weights});
    EXPECT_EQ(many.num_domains, domains);
    const std::set<int> used(many.triangle_domain.begin(), many.triangle_domain.end());
    EXPECT_EQ(used.size(), static_cast<std::size_t>(domains));
  }
}

TEST(DomainWeights, MoreComponentsThanDomainsFillThemByWeight) {
  mesh::TriangleMesh mesh;  // 40 triangles that touch nowhere
  mesh.positions = Positions::Random(120, 3);
  for (int t = 0; t < 40; ++t) mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  const Case c(std::move(mesh));
  const Decomposition d = decompose(c.elements(), {.domains = 2, .domain_weights = {1, 3}});
  EXPECT_EQ(std::count(d.triangle_domain.begin(), d.triangle_domain.end(), 0), 10);
}

TEST(DomainWeights, RefuseNonsense) {
  const Case grid(testing::grid_mesh(5, 5));
  const double inf = std::numeric_limits<double>::infinity();
  for (const std::vector<double>& weights :
       std::vector<std::vector<double>>{{1}, {1, 1, 1}, {1, 0}, {-1, 1}, {1, inf}, {NAN, 1}})
    EXPECT_THROW(decompose(grid.elements(), {.domains = 2, .domain_weights = weights}), InputError);
}

TEST(Decomposition, RefusesNonsense) {
  const Case grid(testing::grid_mesh(3, 3));
  EXPECT_THROW(grid.decompose(0), InputError);
  EXPECT_THROW(grid.decompose(-4), InputError);
  EXPECT_THROW(decompose({{}, {}, {}, 0}, {.domains = 1}), InputError);
}

}  // namespace
}  // namespace piecework::decomposition
