// The parts of the broad phase on their own.

#include <algorithm>
#include <bit>
#include <cstdlib>

#include <gtest/gtest.h>

#include <piecework/core/isa.hpp>
#include <piecework/core/random.hpp>

#include "pair_search.hpp"
#include "radix_tree.hpp"
#include "space_curve.hpp"
#include "unit_frame.hpp"

namespace piecework::collision {
namespace {

using Codes = std::vector<std::uint32_t>;

// At every level of the octree the curve passes through all cells, from each to one beside it.
TEST(SpaceCurve, GoesFromCellToCell) {
  for (const int level : {1, 2, 4, 5}) {
    const int cells = 1 << level;
    std::vector<std::array<int, 3>> visited(static_cast<std::size_t>(cells * cells * cells),
                                            {-1, -1, -1});
    const auto middle = [&](int i) {
      return (static_cast<float>(i) + 0.5F) / static_cast<float>(cells);
    };
    for (int i = 0; i < cells; ++i)
      for (int j = 0; j < cells; ++j)
        for (int k = 0; k < cells; ++k)
          visited[hilbert_code(middle(i), middle(j), middle(k)) >> (30 - 3 * level)] = {i, j, k};
    for (std::size_t n = 0; n < visited.size(); ++n) {
      ASSERT_GE(visited[n][0], 0) << "no cell has place " << n;
      if (n == 0) continue;
      int steps = 0;
      for (std::size_t axis = 0; axis < 3; ++axis)
        steps += std::abs(visited[n][axis] - visited[n - 1][axis]);
      ASSERT_EQ(steps, 1) << n;
    }
  }
}

TEST(SpaceCurve, ClampsWhatIsOutside) {
  EXPECT_EQ(hilbert_code(-1, -1e30F, 0), hilbert_code(0, 0, 0));
  EXPECT_EQ(hilbert_code(1, 2, 1e30F), hilbert_code(0.9999F, 0.9999F, 0.9999F));
  EXPECT_NE(hilbert_code(1, 1, 1), hilbert_code(0, 0, 0));
}

TEST(SpaceCurve, SortsByCodeAndKeepsTheOrderOfEqualOnes) {
  Random random(2);
  for (const std::size_t count : {0U, 1U, 2U, 1000U, 16384U, 50000U})
    for (const double values : {3.0, 1e9}) {
      std::vector<std::uint64_t> keys, spare;
      for (std::size_t i = 0; i < count; ++i)
        keys.push_back(static_cast<std::uint64_t>(random.uniform(0, values)) << 32 | i);
      std::vector<std::uint64_t> expected = keys;
      std::sort(expected.begin(), expected.end());
      sort_by_code(keys, spare);
      EXPECT_TRUE(keys == expected) << count;
    }
}

/// The radix tree by its definition: halves where the highest bit changes in which the codes of a
/// range differ, equal codes where the highest bit of their places does.
void expect_subtree(const Codes& codes, const std::vector<TreeNode>& nodes, std::size_t& k,
                    std::size_t first, std::size_t last) {
  const TreeNode& node = nodes[k];
  EXPECT_EQ(node.skip, static_cast<int>(k + 2 * (last - first) + 1));
  ++k;
  if (first == last) {
    EXPECT_EQ(node.block, static_cast<int>(first));
    return;
  }
  EXPECT_EQ(node.block, -1);
  const bool equal = codes[first] == codes[last];
  const auto key = [&](std::size_t i) { return equal ? i : std::size_t{codes[i]}; };
  const std::size_t bit = std::bit_floor(key(first) ^ key(last));
  std::size_t split = first;
  while ((key(split + 1) & bit) == 0) ++split;
  expect_subtree(codes, nodes, k, first, split);
  expect_subtree(codes, nodes, k, split + 1, last);
}

TEST(RadixTree, IsThatOfItsDefinition) {
  Random random(3);
  std::vector<TreeNode> nodes;
  build_radix_tree({}, nodes);
  EXPECT_TRUE(nodes.empty());
  for (int scene = 0; scene < 200; ++scene) {
    SCOPED_TRACE(scene);
    Codes codes(1 + static_cast<std::size_t>(random.uniform(0, 300)));
    const double values = scene % 4 == 0 ? 1 : scene % 4 == 1 ? 7 : 1e9;
    for (auto& code : codes) code = static_cast<std::uint32_t>(random.uniform(0, values));
    std::sort(codes.begin(), codes.end());
    build_radix_tree(codes, nodes);
    ASSERT_EQ(nodes.size(), 2 * codes.size() - 1);
    std::size_t k = 0;
    expect_subtree(codes, nodes, k, 0, codes.size() - 1);
    EXPECT_EQ(k, nodes.size());
  }
}

TEST(RadixTree, InnerBoxesHoldTheirLeaves) {
  Random random(4);
  std::vector<TreeNode> nodes;
  build_radix_tree(Codes(100, 5), nodes);
  for (TreeNode& node : nodes)
    if (node.block >= 0)
      for (short& number : node.box.number) number = static_cast<short>(random.uniform(-99, 99));
  refit_inner_nodes(nodes);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    BoxRow least = kEmptyRow;
    for (std::size_t i = k; i < static_cast<std::size_t>(nodes[k].skip); ++i)
      if (nodes[i].block >= 0) least = united(least, nodes[i].box);
    EXPECT_TRUE(std::equal(least.number, least.number + 8, nodes[k].box.number));
  }
}

/// Random edges and triangles, searched with the kernels of one instruction set.
std::vector<PairIndex> found_by(Isa isa, bool edges, std::size_t& compared) {
  Random random(5);
  constexpr int vertices = 900;
  std::vector<BoxRow> rows;
  BoxRow bounds = kEmptyRow;
  const UnitFrame frame({Vec3::Zero(), Vec3::Ones()}, 0.05);
  for (int v = 0; v < vertices; ++v) {
    const Vec3 x(random.uniform(), random.uniform(), random.uniform());
    rows.push_back(frame.row({x, x + Vec3::Constant(0.02)}));
    bounds = united(bounds, rows.back());
  }
  const auto near_vertex = [&](int v) { return std::min(v + 1, vertices - 1); };
  std::vector<Element> own, others;
  for (int v = 0; v < vertices; ++v) {
    const int w = near_vertex(v), u = near_vertex(w);
    own.push_back({v, edges ? std::array{v, w, w} : std::array{v, v, v}});
    others.push_back({v, {v, w, u}});
  }
  const std::size_t ranked = edges ? vertices : 0;
  BoxBlocks a(own, ranked), b(others, ranked);
  for (BoxBlocks* blocks : {&a, &b}) {
    blocks->build(rows, bounds);
    blocks->refit(rows);
  }
  PairSearch search({{&a, {edges ? &a : &b}}}, vertices);
  const BoxKernels& kernels = box_kernels(isa);
  // Every second of the doubtful pairs: what the kernels make of the answer shows.
  const Retest retest{nullptr, [](const void*, int p, int q) { return (p + q) % 2 == 0; }};
  std::vector<PairIndex> pairs;
  compared = search.run(edges ? kernels.edges_with_edges : kernels.vertices_with_triangles, kernels,
                        {frame.reach().outer, frame.reach().inner - 500}, retest, pairs);
  return pairs;
}

TEST(BoxKernels, AllInstructionSetsFindTheSame) {
  for (const bool edges : {false, true}) {
    std::size_t expected_tests = 0;
    const std::vector<PairIndex> expected = found_by(Isa::Portable, edges, expected_tests);
    EXPECT_GT(expected.size(), 1000U);
    for (const Isa isa : available_isas()) {
      SCOPED_TRACE(to_string(isa));
      std::size_t tests = 0;
      EXPECT_TRUE(found_by(isa, edges, tests) == expected);
      EXPECT_EQ(tests, expected_tests);
    }
  }
}

TEST(BoxKernels, SortShortLists) {
  Random random(6);
  for (const Isa isa : available_isas())
    for (int count = 0; count <= 64; ++count) {
      std::vector<int> list;
      for (int i = 0; i < count; ++i)
        list.push_back(1000 * i + static_cast<int>(random.uniform(0, 999)));
      std::vector<int> expected = list, sorted(list.size());
      for (std::size_t i = list.size(); i > 1; --i)
        std::swap(list[i - 1],
                  list[static_cast<std::size_t>(random.uniform(0, static_cast<double>(i)))]);
      list.resize(list.size() + kLanes);
      box_kernels(isa).sort(list.data(), count, sorted.data());
      EXPECT_TRUE(sorted == expected) << to_string(isa) << " " << count;
    }
}

}  // namespace
}  // namespace piecework::collision
