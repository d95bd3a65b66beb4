#include "box_blocks.hpp"

#include <algorithm>
#include <bit>

#include <piecework/core/parallel.hpp>

#include "space_curve.hpp"
#include "unit_frame.hpp"

namespace piecework::collision {
namespace {

constexpr std::size_t kBlocksPerTask = 4;

BoxRow row_of(const Element& element, std::span<const BoxRow> rows) {
  BoxRow row = rows[static_cast<std::size_t>(element.vertices[0])];
  for (std::size_t k = 1; k < kMaxVertices; ++k)
    row = united(row, rows[static_cast<std::size_t>(element.vertices[k])]);
  return row;
}

/// Half the surface; of a box with something in it.
double area(const BoxRow& box) {
  std::array<double, 3> side{};
  for (std::size_t k = 0; k < 3; ++k)
    side[k] = -static_cast<double>(box.number[3 + k]) - static_cast<double>(box.number[k]);
  return side[0] * side[1] + side[1] * side[2] + side[2] * side[0];
}

/// Place of the box's middle along the curve through a cube around `bounds`.
std::uint32_t code_of(const BoxRow& box, const BoxRow& bounds) {
  int size = 1;
  for (std::size_t k = 0; k < 3; ++k)
    size = std::max(size, -bounds.number[3 + k] - bounds.number[k]);
  std::array<float, 3> unit{};
  for (std::size_t k = 0; k < 3; ++k) {
    const int twice = box.number[k] - box.number[3 + k] - 2 * bounds.number[k];
    unit[k] = static_cast<float>(twice) / static_cast<float>(2 * size);
  }
  return hilbert_code(unit[0], unit[1], unit[2]);
}

void store(const BoxRow& row, BoxLanes& lanes, int lane) {
  for (int k = 0; k < kNumbers; ++k) lanes.number[k][lane] = row.number[k];
}

}  // namespace

BoxBlocks::BoxBlocks(std::vector<Element> elements, std::size_t num_ranked)
    : elements_(std::move(elements)),
      rank_shift_(num_ranked > 0 ? std::max(0, static_cast<int>(std::bit_width(num_ranked)) - 15)
                                 : 31),
      blocks_((elements_.size() + kBlockSize - 1) / kBlockSize),
      keys_(elements_.size()) {}

void BoxBlocks::build(std::span<const BoxRow> rows, const BoxRow& bounds) {
  parallel_for(elements_.size(), [&](std::size_t e) {
    const std::uint32_t code = code_of(row_of(elements_[e], rows), bounds);
    keys_[e] = std::uint64_t{code} << 32 | e;
  });
  sort_by_code(keys_, spare_keys_);
  std::vector<std::uint32_t> codes(blocks_.size());
  for (std::size_t b = 0; b < blocks_.size(); ++b)
    codes[b] = static_cast<std::uint32_t>(keys_[b * kBlockSize] >> 32);
  build_radix_tree(codes, nodes_);
  node_of_block_.resize(blocks_.size());
  for (std::size_t k = 0; k < nodes_.size(); ++k)
    if (nodes_[k].block >= 0)
      node_of_block_[static_cast<std::size_t>(nodes_[k].block)] = static_cast<int>(k);
  parallel_for(
      blocks_.size(), [&](std::size_t b) { fill_block(b); }, kBlocksPerTask);
}

void BoxBlocks::fill_block(std::size_t b) {
  for (std::size_t i = 0; i < kBlockSize; ++i) {
    LeafItems& items = blocks_[b].items[i / kLanes];
    const std::size_t lane = i % kLanes, place = b * kBlockSize + i;
    const bool filled = place < keys_.size();
    const Element& element = elements_[filled ? keys_[place] & 0xffffffffU : 0];
    items.id[lane] = filled ? element.id : LeafItems::kNoElement;
    for (std::size_t k = 0; k < kMaxVertices; ++k)
      items.vertex[k][lane] = filled ? element.vertices[k] : -1;
  }
}

Areas BoxBlocks::refit_block(std::size_t b, std::span<const BoxRow> rows) {
  Areas areas;
  Block& block = blocks_[b];
  block.box = kEmptyRow;
  for (int leaf = 0; leaf < kLanes; ++leaf) {
    const LeafItems& items = block.items[leaf];
    BoxRow leaf_box = kEmptyRow;
    for (int lane = 0; lane < kLanes; ++lane) {
      BoxRow row = kEmptyRow;
      const int id = items.id[lane];
      if (id != LeafItems::kNoElement) {
        row = row_of({id, {items.vertex[0][lane], items.vertex[1][lane], items.vertex[2][lane]}},
                     rows);
        row.number[kNumbers] = static_cast<short>(id >> rank_shift_);
        row.number[kNumbers - 1] = static_cast<short>(-row.number[kNumbers]);
        areas.elements += area(row);
      }
      store(row, block.elements[leaf], lane);
      leaf_box = united(leaf_box, row);
    }
    store(leaf_box, block.leaves, leaf);
    block.box = united(block.box, leaf_box);
    if (items.id[0] != LeafItems::kNoElement) areas.tree += area(leaf_box);
  }
  nodes_[static_cast<std::size_t>(node_of_block_[b])].box = block.box;
  return areas;
}

Areas BoxBlocks::refit(std::span<const BoxRow> rows) {
  Areas areas = parallel_sum<Areas>(
      blocks_.size(), [&](std::size_t b) { return refit_block(b, rows); }, kBlocksPerTask);
  refit_inner_nodes(nodes_);
  for (const TreeNode& node : nodes_) areas.tree += area(node.box);
  return areas;
}

}  // namespace piecework::collision
