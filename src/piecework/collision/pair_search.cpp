#include "pair_search.hpp"

#include <algorithm>

#include <piecework/core/parallel.hpp>

namespace piecework::collision {
namespace {

constexpr std::size_t kMostStripes = 128;  // enough for balance, few enough for their buffers
constexpr int kShortList = 64;             // longer ones are not sorted by counting

/// Bounds of a block, to be compared with the numbers of a node.
BoxRow bounds_of(const BoxRow& box, int outer) {
  BoxRow q;
  for (int k = 0; k < 6; ++k)
    q.number[k] = static_cast<short>(
        std::clamp<int>(outer - box.number[(k + 3) % 6], kEmptyBound, kMostNumber));
  q.number[6] = static_cast<short>(-box.number[7]);
  q.number[7] = kEmptyNumber;  // not compared
  return q;
}

bool below(const BoxRow& box, const BoxRow& bounds) {
  int all = 1;
  for (int k = 0; k < 8; ++k) all &= box.number[k] <= bounds.number[k] ? 1 : 0;
  return all != 0;
}

/// Lists the blocks of the tree within reach; returns the number of nodes looked at.
std::size_t descend(const std::vector<TreeNode>& nodes, const BoxRow& bounds,
                    std::vector<int>& near) {
  near.clear();
  std::size_t looked_at = 0;
  for (std::size_t k = 0; k < nodes.size(); ++looked_at) {
    const TreeNode& node = nodes[k];
    if (!below(node.box, bounds)) {
      k = static_cast<std::size_t>(node.skip);
      continue;
    }
    if (node.block >= 0) near.push_back(node.block);
    ++k;
  }
  return looked_at;
}

}  // namespace

struct PairSearch::Task {
  Meet meet;
  const BoxKernels& kernels;
  const Reach& reach;
  const Retest& retest;
};

PairSearch::PairSearch(std::vector<SearchGroup> groups, std::size_t num_elements)
    : groups_(std::move(groups)), sources_(num_elements), place_(num_elements + 1) {
  std::size_t total = 0;
  for (const SearchGroup& group : groups_) total += group.own->blocks().size();
  const std::size_t length = (total + kMostStripes - 1) / kMostStripes;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const std::size_t blocks = groups_[g].own->blocks().size();
    for (std::size_t b = 0; b < blocks; b += length) {
      stripes_.push_back({g, b, std::min(b + length, blocks)});
      stripes_.back().near.resize(groups_[g].others.size());
    }
  }
}

std::size_t PairSearch::run(Meet meet, const BoxKernels& kernels, const Reach& reach,
                            const Retest& retest, std::vector<PairIndex>& pairs) {
  const Task task{meet, kernels, reach, retest};
  parallel_for(
      stripes_.size(), [&](std::size_t s) { search_stripe(task, s); }, 1);
  gather(pairs);
  std::size_t compared = 0;
  for (const Stripe& stripe : stripes_) compared += stripe.compared;
  return compared;
}

void PairSearch::search_stripe(const Task& task, std::size_t s) {
  Stripe& stripe = stripes_[s];
  stripe.num_found = stripe.compared = 0;
  const SearchGroup& group = groups_[stripe.group];
  for (std::size_t b = stripe.begin; b < stripe.end; ++b) {
    const Block& block = group.own->blocks()[b];
    const BoxRow bounds = bounds_of(block.box, task.reach.outer);
    for (std::size_t i = 0; i < group.others.size(); ++i)
      stripe.compared += descend(group.others[i]->nodes(), bounds, stripe.near[i]);
    for (int leaf = 0; leaf < kLanes; ++leaf)
      if (block.items[leaf].id[0] != LeafItems::kNoElement) search_leaf(task, s, block, leaf);
  }
}

void PairSearch::search_leaf(const Task& task, std::size_t s, const Block& block, int leaf) {
  Stripe& stripe = stripes_[s];
  const SearchGroup& group = groups_[stripe.group];
  std::size_t room = kLanes;
  for (const auto& near : stripe.near) room += near.size() * kBlockSize;
  if (stripe.hits.size() < kLanes * room) stripe.hits.resize(kLanes * room);
  Hits hits{};
  for (std::size_t lane = 0; lane < kLanes; ++lane) hits.list[lane] = &stripe.hits[lane * room];
  for (std::size_t i = 0; i < group.others.size(); ++i) {
    const std::vector<int>& near = stripe.near[i];
    const LeafQuery query{&block, leaf, group.others[i]->blocks().data(), near.data(),
                          static_cast<int>(near.size())};
    stripe.compared += task.meet(query, task.reach, task.retest, hits);
  }
  for (int lane = 0; lane < kLanes; ++lane) {
    const int id = block.items[leaf].id[lane];
    if (id != LeafItems::kNoElement) keep(task, s, id, hits.list[lane], hits.count[lane]);
  }
}

void PairSearch::keep(const Task& task, std::size_t s, int id, int* list, int count) {
  Stripe& stripe = stripes_[s];
  const auto size = static_cast<std::size_t>(count);
  sources_[static_cast<std::size_t>(id)] = {static_cast<std::uint32_t>(s),
                                            static_cast<std::uint32_t>(count), stripe.num_found};
  if (stripe.found.size() < stripe.num_found + size)
    stripe.found.resize(2 * (stripe.num_found + size));
  int* sorted = stripe.found.data() + stripe.num_found;
  if (count <= kShortList) {
    task.kernels.sort(list, count, sorted);
  } else {
    std::sort(list, list + count);
    std::copy(list, list + count, sorted);
  }
  stripe.num_found += size;
}

void PairSearch::gather(std::vector<PairIndex>& pairs) {
  for (std::size_t e = 0; e < sources_.size(); ++e) place_[e + 1] = place_[e] + sources_[e].count;
  pairs.resize(place_.back());
  parallel_for(sources_.size(), [&](std::size_t e) {
    const Source& source = sources_[e];
    if (source.count == 0) return;
    const int* partner = stripes_[source.stripe].found.data() + source.begin;
    PairIndex* pair = pairs.data() + place_[e];
    for (std::size_t i = 0; i < source.count; ++i) pair[i] = {static_cast<int>(e), partner[i]};
  });
}

}  // namespace piecework::collision
