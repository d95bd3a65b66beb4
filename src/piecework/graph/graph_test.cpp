#include <piecework/graph/graph.hpp>

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

namespace piecework::graph {
namespace {

/// A grid of `columns` x `rows` nodes with edges to the four nearest.
Graph grid(int columns, int rows) {
  Graph result;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const auto add = [&](int column, int row) {
        if (column >= 0 && column < columns && row >= 0 && row < rows)
          result.neighbor.push_back(row * columns + column);
      };
      add(c, r - 1);
      add(c - 1, r);
      add(c + 1, r);
      add(c, r + 1);
      result.begin.push_back(static_cast<int>(result.neighbor.size()));
    }
  return result;
}

TEST(Graph, OfAPatternIsTheSameFromOneTriangleOrBoth) {
  // 3 x 3 with entries (0,0) (1,0) (2,1) (2,2); then with their mirror images.
  const Graph lower = graph_of_pattern(std::vector{0, 2, 3, 4}, std::vector{0, 1, 2, 2});
  const Graph both = graph_of_pattern(std::vector{0, 2, 4, 6}, std::vector{1, 0, 0, 2, 2, 1});
  EXPECT_EQ(lower.begin, (std::vector{0, 1, 3, 4}));
  EXPECT_EQ(lower.neighbor, (std::vector{1, 0, 2, 1}));
  EXPECT_EQ(both.begin, lower.begin);
  EXPECT_EQ(both.neighbor, lower.neighbor);
}

TEST(Graph, EmptyOnesAreFine) {
  const Graph none = graph_of_pattern(std::vector{0}, {});
  EXPECT_EQ(none.size(), 0);
  EXPECT_TRUE(nested_dissection(none, 1).empty());
  EXPECT_TRUE(linear_order(none).empty());
  const Graph lonely = graph_of_pattern(std::vector{0, 1, 2}, std::vector{0, 1});
  EXPECT_EQ(nested_dissection(lonely, 1), (std::vector{0, 1}));
}

TEST(Graph, SubgraphKeepsEdgesInsideOnlyAndCleansUp) {
  const Graph whole = grid(3, 3);
  std::vector<int> scratch(9, -1);
  const Graph part = subgraph(whole, std::vector{4, 1, 8}, scratch);
  EXPECT_EQ(part.begin, (std::vector{0, 1, 2, 2}));  // 4 - 1, and 8 alone
  EXPECT_EQ(part.neighbor, (std::vector{1, 0}));
  EXPECT_EQ(scratch, std::vector<int>(9, -1));
}

TEST(Graph, LinearOrderFollowsAPathWhereverItStarts) {
  // The path 3 - 0 - 4 - 1 - 2.
  Graph path;
  path.begin = {0, 2, 4, 5, 6, 8};
  path.neighbor = {3, 4, 2, 4, 1, 0, 0, 1};
  const std::vector<int> order = linear_order(path);
  const std::vector<int> forth{3, 0, 4, 1, 2};
  const std::vector<int> back(forth.rbegin(), forth.rend());
  EXPECT_TRUE(order == forth || order == back);
}

TEST(Graph, BisectionSplitsAGridInHalves) {
  const Graph whole = grid(20, 10);
  std::vector<std::int32_t> side;
  ASSERT_TRUE(bisect(whole, std::vector<std::int32_t>(200, 1), 0.5, 1, side));
  EXPECT_NEAR(std::accumulate(side.begin(), side.end(), 0), 100, 5);
}

TEST(Graph, DissectionIsARepeatablePermutation) {
  const Graph whole = grid(30, 30);
  const std::vector<int> order = nested_dissection(whole, 1);
  EXPECT_EQ(order, nested_dissection(whole, 1));
  std::vector<int> sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (int i = 0; i < 900; ++i) EXPECT_EQ(sorted[static_cast<std::size_t>(i)], i);
}

}  // namespace
}  // namespace piecework::graph
