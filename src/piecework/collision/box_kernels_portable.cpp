// Kernels in plain C++: what every machine can run, and what the others are tested against.

#include "box_kernels.hpp"

namespace piecework::collision {
namespace {

struct PlainLanes {
  /// Bits of the lanes for which test(lane) holds.
  template <class Test>
  static unsigned bits(const Test& test) {
    unsigned result = 0;
    for (int i = 0; i < kLanes; ++i) result |= static_cast<unsigned>(test(i)) << i;
    return result;
  }

  /// The boxes whose numbers are all below bound[k * stride].
  static unsigned below(const BoxLanes& boxes, const short* bound, int stride) {
    short in[kLanes];
    for (int i = 0; i < kLanes; ++i) in[i] = 1;
    for (int k = 0; k < kNumbers; ++k)
      for (int i = 0; i < kLanes; ++i) in[i] &= boxes.number[k][i] <= bound[k * stride] ? 1 : 0;
    return bits([&](int i) { return in[i] != 0; });
  }
  /// The bounds that are all above the box, whose numbers stand kLanes apart.
  static unsigned above(const short* box, const BoxLanes& bounds) {
    short in[kLanes];
    for (int i = 0; i < kLanes; ++i) in[i] = 1;
    for (int k = 0; k < kNumbers; ++k)
      for (int i = 0; i < kLanes; ++i) in[i] &= box[k * kLanes] <= bounds.number[k][i] ? 1 : 0;
    return bits([&](int i) { return in[i] != 0; });
  }
  static unsigned equal(const int* lanes, int number) {
    return bits([&](int i) { return lanes[i] == number; });
  }
  static unsigned greater(const int* lanes, int number) {
    return bits([&](int i) { return lanes[i] > number; });
  }
  /// Writes the lanes whose bits are set; returns how many.
  static int append(int* end, const int* lanes, unsigned mask) {
    int count = 0;
    for (; mask != 0; mask &= mask - 1) end[count++] = lanes[__builtin_ctz(mask)];
    return count;
  }
};

}  // namespace

#include "box_kernels_impl.hpp"

const BoxKernels& portable_box_kernels() {
  static constexpr BoxKernels kTable = BoxLoops<PlainLanes>::table();
  return kTable;
}

}  // namespace piecework::collision
