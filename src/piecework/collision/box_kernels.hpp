#pragma once

// The innermost loops of the broad phase, compiled once per instruction set and chosen at run time.
// Private to `collision`.

#include <cstddef>

#include <piecework/core/isa.hpp>

#include "box_lanes.hpp"

namespace piecework::collision {

/// Ids found so far for each element of a leaf. Room: kBlockSize for each block that is looked at,
/// and kLanes more.
struct Hits {
  int* list[kLanes];
  int count[kLanes];
};

/// Decides what single precision leaves open.
struct Retest {
  const void* context;
  bool (*near)(const void* context, int a, int b);
};

/// Leaf `leaf` of block `own` against the blocks blocks[near[i]], i < count.
struct LeafQuery {
  const Block* own;
  int leaf;
  const Block* blocks;
  const int* near;
  int count;
};

struct BoxKernels {
  /// Appends the partners of every element of the leaf: those within reach that share no vertex;
  /// of edges, those with a higher id. Returns the number of boxes compared.
  std::size_t (*vertices_with_triangles)(const LeafQuery& query, const Reach& reach,
                                         const Retest& retest, Hits& hits);
  std::size_t (*edges_with_edges)(const LeafQuery& query, const Reach& reach, const Retest& retest,
                                  Hits& hits);
  /// Writes `count` different numbers in ascending order. Quadratic, meant for short lists.
  /// \param list  kLanes more can be read
  void (*sort)(const int* list, int count, int* sorted);
};

/// \pre this processor runs `isa`.
const BoxKernels& box_kernels(Isa isa);

const BoxKernels& portable_box_kernels();
const BoxKernels& avx2_box_kernels();
const BoxKernels& avx512_box_kernels();

}  // namespace piecework::collision
