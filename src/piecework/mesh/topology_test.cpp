#include <piecework/mesh/topology.hpp>

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>
#include <piecework/mesh/generate.hpp>

namespace piecework::mesh {
namespace {

/// An irregular mesh with holes and several components: a Delaunay sheet without every fourth
/// triangle, in random order.
Triangles ragged_mesh() {
  GeneratorOptions options;
  options.columns = 13;
  options.rows = 11;
  options.pattern = SheetPattern::Delaunay;
  Triangles triangles = generate(GeneratorKind::Sheet, options).mesh.triangles;
  Random random(5);
  for (std::size_t i = triangles.size() - 1; i > 0; --i)
    std::swap(triangles[i], triangles[random.next() % (i + 1)]);
  triangles.resize(triangles.size() * 3 / 4);
  return triangles;
}

bool uses(const Triangle& t, int v) { return std::find(t.begin(), t.end(), v) != t.end(); }

TEST(Topology, EdgesMatchBruteForce) {
  const Triangles triangles = ragged_mesh();
  std::map<std::array<int, 2>, std::vector<int>> expected;
  for (int t = 0; t < static_cast<int>(triangles.size()); ++t) {
    for (int a : triangles[t]) {
      for (int b : triangles[t]) {
        if (a < b) expected[{a, b}].push_back(t);
      }
    }
  }
  const std::vector<Edge> edges = find_edges(triangles);
  ASSERT_EQ(edges.size(), expected.size());
  auto entry = expected.begin();
  int num_border = 0;
  for (const Edge& edge : edges) {
    EXPECT_EQ(edge.vertices, entry->first);
    EXPECT_EQ(edge.triangles[0], entry->second[0]);
    EXPECT_EQ(edge.triangles[1], entry->second.size() > 1 ? entry->second[1] : -1);
    num_border += edge.triangles[1] < 0;
    ++entry;
  }
  EXPECT_GT(num_border, 48);  // more than the sheet's own border: there are holes
}

TEST(Topology, HingesNameTheSharedEdgeAndWhatIsAcross) {
  const Triangles triangles = ragged_mesh();
  const std::vector<Edge> edges = find_edges(triangles);
  const std::vector<Hinge> hinges = find_hinges(triangles, edges);
  std::size_t next = 0;
  for (const Edge& edge : edges) {
    if (edge.triangles[1] < 0) continue;
    ASSERT_LT(next, hinges.size());
    const Hinge& hinge = hinges[next++];
    EXPECT_EQ(hinge.triangles, edge.triangles);
    EXPECT_LT(hinge.triangles[0], hinge.triangles[1]);
    EXPECT_EQ(hinge.vertices[0], edge.vertices[0]);
    EXPECT_EQ(hinge.vertices[1], edge.vertices[1]);
    for (int side : {0, 1}) {
      EXPECT_TRUE(uses(triangles[hinge.triangles[side]], hinge.vertices[2 + side]));
      EXPECT_FALSE(uses(triangles[hinge.triangles[1 - side]], hinge.vertices[2 + side]));
    }
  }
  EXPECT_EQ(next, hinges.size());
  EXPECT_GT(next, 0U);
}

TEST(Topology, ComponentsMatchRepeatedMerging) {
  const Triangles triangles = ragged_mesh();
  std::vector<int> component;
  const int count = edge_components(triangles, find_edges(triangles), component);
  // The oracle spreads the smaller label over every pair of triangles with two common vertices.
  std::vector<int> label(triangles.size());
  for (std::size_t t = 0; t < label.size(); ++t) label[t] = static_cast<int>(t);
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t a = 0; a < label.size(); ++a) {
      for (std::size_t b = 0; b < label.size(); ++b) {
        int common = 0;
        for (int v : triangles[a]) common += uses(triangles[b], v);
        if (common < 2 || label[b] <= label[a]) continue;
        label[b] = label[a];
        changed = true;
      }
    }
  }
  std::map<int, int> number;
  for (std::size_t t = 0; t < label.size(); ++t) {
    const int next = static_cast<int>(number.size());
    EXPECT_EQ(component[t], number.try_emplace(label[t], next).first->second);
  }
  EXPECT_EQ(count, static_cast<int>(number.size()));
  EXPECT_GT(count, 1);
}

TEST(Topology, BorderAndVertexTriangles) {
  const Triangles triangles = ragged_mesh();
  const std::vector<Edge> edges = find_edges(triangles);
  std::set<int> expected;
  for (const Edge& edge : edges) {
    if (edge.triangles[1] < 0) expected.insert(edge.vertices.begin(), edge.vertices.end());
  }
  EXPECT_EQ(border_vertices(edges), std::vector<int>(expected.begin(), expected.end()));

  constexpr int kVertices = 200;  // more than the mesh has: the last rows are empty
  const Adjacency around = vertex_triangles(triangles, kVertices);
  ASSERT_EQ(around.begin.size(), kVertices + 1U);
  for (int v = 0; v < kVertices; ++v) {
    std::vector<int> scanned;
    for (int t = 0; t < static_cast<int>(triangles.size()); ++t) {
      if (uses(triangles[t], v)) scanned.push_back(t);
    }
    EXPECT_EQ(std::vector<int>(around.item.begin() + around.begin[v],
                               around.item.begin() + around.begin[v + 1]),
              scanned);
  }
}

TEST(Topology, FansOfABowTieAreApart) {
  const Triangles bow_tie{{0, 1, 2}, {0, 3, 4}, {0, 2, 5}};
  const std::vector<int> fan = corner_fans(bow_tie, sorted_half_edges(bow_tie));
  EXPECT_NE(fan[0], fan[3]);  // vertex 0 in triangles 0 and 1
  EXPECT_EQ(fan[0], fan[6]);  // triangles 0 and 2 share the edge (0, 2)
  EXPECT_EQ(fan[2], fan[7]);
}

TEST(Topology, EmptyMesh) {
  EXPECT_TRUE(find_edges({}).empty());
  EXPECT_TRUE(find_hinges({}, {}).empty());
  std::vector<int> component{1, 2};
  EXPECT_EQ(edge_components({}, {}, component), 0);
  EXPECT_TRUE(component.empty());
  EXPECT_EQ(vertex_triangles({}, 2).begin, (std::vector<int>{0, 0, 0}));
}

}  // namespace
}  // namespace piecework::mesh
