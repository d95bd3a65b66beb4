#pragma once

// Pairs of elements within reach, in ascending order. Private to `collision`.

#include <cstdint>
#include <vector>

#include <piecework/collision/broad_phase.hpp>

#include "box_blocks.hpp"
#include "box_kernels.hpp"

namespace piecework::collision {

/// The elements of `own` look for partners among those of `others`, one after the other.
struct SearchGroup {
  const BoxBlocks* own;
  std::vector<const BoxBlocks*> others;
};

/// Blocks of the groups are dealt out in stripes, which run in parallel; every stripe keeps what
/// its elements found, and at the end the lists are put in the order of the elements. So neither
/// the pairs nor their order depend on threads, and buffers keep their sizes from call to call.
class PairSearch {
 public:
  using Meet = decltype(BoxKernels::edges_with_edges);

  /// \param num_elements  ids are below
  PairSearch(std::vector<SearchGroup> groups, std::size_t num_elements);

  /// \param[out] pairs  (element of `own`, partner), ascending
  /// \returns the number of boxes compared
  std::size_t run(Meet meet, const BoxKernels& kernels, const Reach& reach, const Retest& retest,
                  std::vector<PairIndex>& pairs);

 private:
  struct Stripe {
    std::size_t group, begin, end;       // blocks
    std::vector<std::vector<int>> near;  // for each of the others: blocks within reach of a block
    std::vector<int> hits;               // room for the lists of a leaf
    std::vector<int> found;              // partners, list after list
    std::size_t num_found = 0;
    std::size_t compared = 0;
  };
  /// Where the partners of an element are.
  struct Source {
    std::uint32_t stripe = 0, count = 0;
    std::size_t begin = 0;
  };
  struct Task;

  void search_stripe(const Task& task, std::size_t s);
  void search_leaf(const Task& task, std::size_t s, const Block& block, int leaf);
  void keep(const Task& task, std::size_t s, int id, int* list, int count);
  void gather(std::vector<PairIndex>& pairs);

  std::vector<SearchGroup> groups_;
  std::vector<Stripe> stripes_;
  std::vector<Source> sources_;     // by element
  std::vector<std::size_t> place_;  // of the first pair of each element
};

}  // namespace piecework::collision
