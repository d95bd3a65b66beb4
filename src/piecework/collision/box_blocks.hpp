#pragma once

// Elements of one kind and one body in blocks along a space-filling curve, under a radix tree.
// Private to `collision`.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "box_lanes.hpp"
#include "radix_tree.hpp"

namespace piecework::collision {

struct Element {
  int id;
  std::array<int, kMaxVertices> vertices;  ///< the last one repeated if there are fewer
};

/// Surface areas in steps: how loosely the tree fits around what it holds.
struct Areas {
  double elements = 0;
  double tree = 0;  ///< of leaves, blocks and inner nodes

  Areas& operator+=(const Areas& other) {
    elements += other.elements;
    tree += other.tree;
    return *this;
  }
};

class BoxBlocks {
 public:
  /// \param num_ranked  ids are below, also those of blocks to be searched: boxes know their ranks,
  ///                    so that a search can leave out lower ones; 0: all have the same rank
  BoxBlocks(std::vector<Element> elements, std::size_t num_ranked);

  /// Sorts the elements by where they are now and builds the tree. refit() must follow.
  /// \param rows  boxes of all vertices
  /// \param bounds  around the rows of this body
  void build(std::span<const BoxRow> rows, const BoxRow& bounds);

  /// Boxes anew in the order of the last build().
  Areas refit(std::span<const BoxRow> rows);

  [[nodiscard]] const std::vector<Block>& blocks() const { return blocks_; }
  [[nodiscard]] const std::vector<TreeNode>& nodes() const { return nodes_; }

 private:
  void fill_block(std::size_t b);
  Areas refit_block(std::size_t b, std::span<const BoxRow> rows);

  std::vector<Element> elements_;
  int rank_shift_ = 0;  // ranks are ids without their last bits: 15 are left, or none
  std::vector<Block> blocks_;
  std::vector<TreeNode> nodes_;
  std::vector<int> node_of_block_;
  std::vector<std::uint64_t> keys_, spare_keys_;  // code and number of each element, sorted
};

}  // namespace piecework::collision
