#include "radix_tree.hpp"

#include <algorithm>
#include <bit>

#include <piecework/core/parallel.hpp>

#include "unit_frame.hpp"

namespace piecework::collision {
namespace {

/// Leaves [first, last] below an inner node, of which those to `split` are in its left child.
struct Range {
  int first, last, split;
};

/// Length of the longest common prefix of the codes at i and j, their places included; -1 outside.
int common_prefix(const std::vector<std::uint32_t>& codes, int i, int j) {
  if (j < 0 || j >= static_cast<int>(codes.size())) return -1;
  const std::uint32_t a = codes[static_cast<std::size_t>(i)];
  const std::uint32_t b = codes[static_cast<std::size_t>(j)];
  if (a != b) return std::countl_zero(a ^ b);
  return 32 + std::countl_zero(static_cast<std::uint32_t>(i ^ j));
}

/// Inner node i by [Karras 2012, Sec. 4]: it is at one end of its range; each is found on its own,
/// by binary search, so all of them at once.
Range find_range(const std::vector<std::uint32_t>& codes, int i) {
  const auto prefix = [&](int j) { return common_prefix(codes, i, j); };
  const int d = prefix(i + 1) > prefix(i - 1) ? 1 : -1;
  const int outside = prefix(i - d);
  int bound = 2;
  while (prefix(i + bound * d) > outside) bound *= 2;
  int length = 0;
  for (int step = bound / 2; step > 0; step /= 2)
    if (prefix(i + (length + step) * d) > outside) length += step;
  const int other = i + length * d;

  const int inside = prefix(other);
  int to_split = 0;
  for (int step = length; step > 1;) {
    step = (step + 1) / 2;
    if (prefix(i + (to_split + step) * d) > inside) to_split += step;
  }
  return {std::min(i, other), std::max(i, other), i + to_split * d + std::min(d, 0)};
}

}  // namespace

void build_radix_tree(const std::vector<std::uint32_t>& codes, std::vector<TreeNode>& nodes) {
  const std::size_t n = codes.size();
  nodes.assign(n > 0 ? 2 * n - 1 : 0, {kEmptyRow, 0, -1});
  if (n == 0) return;
  std::vector<Range> ranges(n - 1);
  parallel_for(n - 1, [&](std::size_t i) { ranges[i] = find_range(codes, static_cast<int>(i)); });

  // Where a node stands follows from its parent's place and the sizes of the subtrees before it.
  struct Visit {
    int place, first, last, inner;
  };
  std::vector<Visit> open{{0, 0, static_cast<int>(n) - 1, 0}};
  while (!open.empty()) {
    const Visit v = open.back();
    open.pop_back();
    TreeNode& node = nodes[static_cast<std::size_t>(v.place)];
    node.skip = v.place + 2 * (v.last - v.first) + 1;
    if (v.first == v.last) {
      node.block = v.first;
      continue;
    }
    const int split = ranges[static_cast<std::size_t>(v.inner)].split;
    open.push_back({v.place + 1, v.first, split, split});
    open.push_back({v.place + 2 * (split - v.first + 1), split + 1, v.last, split + 1});
  }
}

void refit_inner_nodes(std::vector<TreeNode>& nodes) {
  for (std::size_t k = nodes.size(); k-- > 0;) {
    TreeNode& node = nodes[k];
    if (node.block >= 0) continue;
    const TreeNode& left = nodes[k + 1];
    node.box = united(left.box, nodes[static_cast<std::size_t>(left.skip)].box);
  }
}

}  // namespace piecework::collision
