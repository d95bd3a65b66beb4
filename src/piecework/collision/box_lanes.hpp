#pragma once

// Boxes as the broad phase compares them: in whole steps of a grid, 16 bits each, sixteen boxes at
// once. Private to `collision`.
//
// A box is seven numbers: low x, y, z and -high x, y, z, rounded down, and -last, where `last` is
// the largest rank of an element in it. A box n is within reach of another one if n[k] <= q[k] for
// all k, where q are the bounds of that other box: reach minus its number on the opposite side, and
// -first, since a pair belongs to the element of the lower rank.
//
// Kernels of several instruction sets include this: no functions here, and no other header, of
// whose inline functions the linker might keep the wrong copy.

namespace piecework::collision {

inline constexpr int kLanes =
    16;  ///< boxes compared at once: elements of a leaf, leaves of a block
inline constexpr int kNumbers = 7;  ///< of a box
inline constexpr int kBlockSize = kLanes * kLanes;
inline constexpr int kMaxVertices = 3;  ///< of an element

inline constexpr short kMostNumber = 32766;   ///< coordinates and bounds are up to +-this, but
inline constexpr short kEmptyNumber = 32767;  ///< a number of a box with nothing in it, and
inline constexpr short kEmptyBound = -32768;  ///< a bound that nothing is within

/// One box: its seven numbers and the smallest rank in it.
struct alignas(16) BoxRow {
  short number[8];
};

/// Sixteen boxes, number by number.
struct alignas(32) BoxLanes {
  short number[kNumbers][kLanes];
};

/// What sixteen elements are. Lanes without one have an empty box and kNoElement.
struct alignas(64) LeafItems {
  static constexpr int kNoElement = __INT_MAX__;

  int id[kLanes];
  int vertex[kMaxVertices][kLanes];  ///< the last one repeated if there are fewer
};

/// 256 elements that are neighbours in space.
struct Block {
  BoxRow box;
  BoxLanes leaves;            ///< the boxes of the sixteen leaves
  BoxLanes elements[kLanes];  ///< of each leaf
  LeafItems items[kLanes];
};

/// Box that no bound reaches.
inline constexpr BoxRow kEmptyRow{{kEmptyNumber, kEmptyNumber, kEmptyNumber, kEmptyNumber,
                                   kEmptyNumber, kEmptyNumber, kEmptyNumber, kEmptyNumber}};

/// The gap in steps, widened and narrowed by what rounding may do to a comparison: two boxes
/// further apart than `outer` are certainly no pair, and as close as `inner` certainly one.
struct Reach {
  int outer, inner;
};

}  // namespace piecework::collision
