#pragma once

// Boxes as the broad phase compares them: in single precision, in a frame of the cloth's size, and
// sixteen at once. Private to `collision`.
//
// A box is seven numbers: low x, y, z, -high x, y, z and -last, where `last` is the largest id of
// an element in it. A box n is within reach of another one exactly if n[k] <= q[k] for all k, where
// q are the bounds of that other box: high + gap, gap - low, and -id, since a pair belongs to the
// element of the lower id.
//
// Kernels of several instruction sets include this: no functions here, and no other header, of
// whose inline functions the linker might keep the wrong copy.

namespace piecework::collision {

inline constexpr int kLanes =
    16;  ///< boxes compared at once: elements of a leaf, leaves of a block
inline constexpr int kNumbers = 7;  ///< of a box
inline constexpr int kBlockSize = kLanes * kLanes;
inline constexpr int kMaxVertices = 3;  ///< of an element

/// One box: its seven numbers and the smallest id in it. 32 bytes: a gather touches one cache line.
struct alignas(32) BoxRow {
  float number[8];
};

/// Sixteen boxes, number by number.
struct alignas(64) BoxLanes {
  float number[kNumbers][kLanes];
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
inline constexpr BoxRow kEmptyRow{{__builtin_inff(), __builtin_inff(), __builtin_inff(),
                                   __builtin_inff(), __builtin_inff(), __builtin_inff(),
                                   __builtin_inff(), __builtin_inff()}};

/// The gap in the unit frame, widened and narrowed by what rounding may do to a comparison: two
/// boxes further apart than `outer` are certainly no pair, and closer than `inner` certainly one.
/// Four roundings to 24 bits of numbers up to 2 + 2 gap in all (two coordinates, the gap, the
/// bound); allowed are twice as many.
struct Reach {
  float outer, inner;
};

}  // namespace piecework::collision
