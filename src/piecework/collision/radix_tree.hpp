#pragma once

// The binary radix tree over sorted codes [Karras 2012]. Private to `collision`.

#include <cstdint>
#include <vector>

#include "box_lanes.hpp"

namespace piecework::collision {

/// Nodes stand in the order in which a descent meets them: the left child of node k is k + 1, and
/// what follows when k is passed over is `skip`, which for a left child is the right one.
struct alignas(64) TreeNode {
  BoxRow box;
  int skip;
  int block;  ///< of a leaf; -1: an inner node
};

/// The tree with a leaf for each code, without boxes: 2 n - 1 nodes, none for no code.
/// \pre codes are ascending; equal ones are told apart by their places
void build_radix_tree(const std::vector<std::uint32_t>& codes, std::vector<TreeNode>& nodes);

/// Boxes of inner nodes from those of their children.
void refit_inner_nodes(std::vector<TreeNode>& nodes);

}  // namespace piecework::collision
