// Domains across seams.

#include <numeric>
#include <set>

#include <gtest/gtest.h>

#include <piecework/decomposition/decomposition.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/testing/patchwork.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::decomposition {
namespace {

struct Sewn {
  explicit Sewn(const std::vector<testing::Patch>& patches, bool bending)
      : model(testing::cloth_model(testing::patchwork(patches),
                                   testing::cotton(bending ? std::optional(1e-3) : std::nullopt))) {
    model.sewing = model::Sewing(mesh::resolve_seams(testing::geometric_stitches(patches),
                                                     model.num_vertices(), testing::plain_names()),
                                 model.start);
    neighbors = mesh::seam_neighbors(model.triangles, model.sewing.map());
  }
  [[nodiscard]] Elements elements() const {
    return {model.triangles,      model.hinges,        model.hinge_bends,
            model.num_vertices(), &model.sewing.map(), neighbors};
  }
  model::ClothModel model;
  std::vector<std::array<int, 2>> neighbors;
};

bool on_one_path(const Decomposition& d, int u, int v) {
  for (int node = u; node >= 0; node = d.nodes[static_cast<std::size_t>(node)].parent)
    if (node == v) return true;
  for (int node = v; node >= 0; node = d.nodes[static_cast<std::size_t>(node)].parent)
    if (node == u) return true;
  return false;
}

// The property that the solvers rest on, checked on the matrix itself.
TEST(SewnDecomposition, TheTreeIsAnEliminationTreeOfTheReducedMatrix) {
  for (const bool bending : {false, true})
    for (const int domains : {1, 2, 3, 4, 7, 16}) {
      SCOPED_TRACE(domains);
      const Sewn sewn(testing::four_patches(), bending);
      const Decomposition d = decompose(sewn.elements(), {.domains = domains});
      ASSERT_EQ(d.num_domains, domains);
      const model::Reduction reduction(
          sewn.model, std::vector<char>(static_cast<std::size_t>(sewn.model.num_vertices()), 0));
      const SparseMatrix K = reduction.system(model::assemble_system(sewn.model, 0.01));
      ASSERT_EQ(K.rows(), sewn.model.num_free());
      for (int column = 0; column < K.outerSize(); ++column)
        for (SparseMatrix::InnerIterator it(K, column); it; ++it) {
          const int u = d.vertex_node[static_cast<std::size_t>(reduction.vertex(column))];
          const int v =
              d.vertex_node[static_cast<std::size_t>(reduction.vertex(static_cast<int>(it.row())))];
          ASSERT_GE(u, 0);
          ASSERT_GE(v, 0);
          ASSERT_TRUE(on_one_path(d, u, v)) << it.row() << " " << column;
        }
      for (const int slave : sewn.model.sewing.map().slaves) {
        EXPECT_EQ(d.vertex_node[static_cast<std::size_t>(slave)], -1);
        EXPECT_EQ(d.vertex_domains.begin[static_cast<std::size_t>(slave)],
                  d.vertex_domains.begin[static_cast<std::size_t>(slave) + 1]);
      }
    }
}

TEST(SewnDecomposition, CarriersBelongToTheDomainsOfTheirSlaves) {
  const Sewn sewn(testing::four_patches(), true);
  const Decomposition d = decompose(sewn.elements(), {.domains = 8});
  std::vector<std::set<int>> expected(static_cast<std::size_t>(sewn.model.num_vertices()));
  const auto add = [&](int vertex, int domain) {
    sewn.model.sewing.map().visit_carriers(vertex, [&](int carrier, double) {
      expected[static_cast<std::size_t>(carrier)].insert(domain);
    });
  };
  for (std::size_t t = 0; t < sewn.model.triangles.size(); ++t)
    for (const int v : sewn.model.triangles[t]) add(v, d.triangle_domain[t]);
  for (std::size_t h = 0; h < sewn.model.hinges.size(); ++h)
    for (const int v : sewn.model.hinges[h].vertices) add(v, d.hinge_domain[h]);
  for (std::size_t v = 0; v < expected.size(); ++v) {
    const std::set<int> found(d.vertex_domains.item.begin() + d.vertex_domains.begin[v],
                              d.vertex_domains.item.begin() + d.vertex_domains.begin[v + 1]);
    EXPECT_EQ(found, expected[v]) << v;
  }
}

// Fewer domains than patches: only what is sewn together can be divided together.
TEST(SewnDecomposition, WhatIsSewnTogetherIsDividedTogether) {
  const Sewn sewn(testing::four_patches(), false);
  const Decomposition d = decompose(sewn.elements(), {.domains = 3});
  EXPECT_TRUE(d.notes.empty()) << "one component, not four in three domains";
  const Summary s = summarize(d, sewn.elements());
  EXPECT_LT(s.balance, 1.15);
  EXPECT_GT(s.boundary, 0);
  EXPECT_EQ(s.remainder + s.corner, sewn.model.num_free());
  // Every domain is connected through edges and seams.
  std::vector<int> root(sewn.model.triangles.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int t) {
    while (root[static_cast<std::size_t>(t)] != t) t = root[static_cast<std::size_t>(t)];
    return t;
  };
  const auto join = [&](const std::array<int, 2>& t) {
    if (d.triangle_domain[static_cast<std::size_t>(t[0])] ==
        d.triangle_domain[static_cast<std::size_t>(t[1])])
      root[static_cast<std::size_t>(find(t[0]))] = find(t[1]);
  };
  for (const mesh::Hinge& hinge : sewn.model.hinges) join(hinge.triangles);
  for (const auto& pair : sewn.neighbors) join(pair);
  std::set<int> roots;
  for (std::size_t t = 0; t < root.size(); ++t) roots.insert(find(static_cast<int>(t)));
  EXPECT_EQ(roots.size(), 3U);
}

TEST(SewnDecomposition, DomainsThatFaceEachOtherAreAdjacent) {
  const Sewn sewn({{0, 0, 1, 1, 5, 5}, {1, 0, 2, 1, 5, 8}}, false);
  Decomposition d = decompose(sewn.elements(), {.domains = 2});
  for (std::size_t t = 0; t < d.triangle_domain.size(); ++t) d.triangle_domain[t] = t < 32 ? 0 : 1;
  EXPECT_TRUE(adjacent_domains(d, sewn.model.hinges).empty());
  const auto pairs = adjacent_domains(d, sewn.model.hinges, sewn.neighbors);
  EXPECT_EQ(pairs, (std::vector<std::array<int, 2>>{{0, 1}}));
}

}  // namespace
}  // namespace piecework::decomposition
