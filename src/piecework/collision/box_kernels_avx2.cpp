// Kernels for AVX2; compiled with that flag, called only where it exists.

#include <immintrin.h>

#include "box_kernels.hpp"

namespace piecework::collision {
namespace {

struct Avx2Lanes {
  static unsigned bits(__m256 mask) { return static_cast<unsigned>(_mm256_movemask_ps(mask)); }
  static __m256i integers(const int* lanes) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(lanes));
  }
  static __m256 at_most(__m256 a, __m256 b) { return _mm256_cmp_ps(a, b, _CMP_LE_OQ); }

  static unsigned below(const BoxLanes& boxes, const float* bound, int stride) {
    __m256 in = at_most(_mm256_load_ps(boxes.number[0]), _mm256_broadcast_ss(bound));
    for (int k = 1; k < kNumbers; ++k)
      in = _mm256_and_ps(
          in, at_most(_mm256_load_ps(boxes.number[k]), _mm256_broadcast_ss(bound + k * stride)));
    return bits(in);
  }
  static unsigned above(const float* box, const BoxLanes& bounds) {
    __m256 in = at_most(_mm256_broadcast_ss(box), _mm256_load_ps(bounds.number[0]));
    for (int k = 1; k < kNumbers; ++k)
      in = _mm256_and_ps(
          in, at_most(_mm256_broadcast_ss(box + k * kLanes), _mm256_load_ps(bounds.number[k])));
    return bits(in);
  }
  static unsigned equal(const int* lanes, int number) {
    return bits(
        _mm256_castsi256_ps(_mm256_cmpeq_epi32(integers(lanes), _mm256_set1_epi32(number))));
  }
  static unsigned greater(const int* lanes, int number) {
    return bits(
        _mm256_castsi256_ps(_mm256_cmpgt_epi32(integers(lanes), _mm256_set1_epi32(number))));
  }
  static int append(int* end, const int* lanes, unsigned mask) {
    int count = 0;
    for (; mask != 0; mask &= mask - 1) end[count++] = lanes[__builtin_ctz(mask)];
    return count;
  }
};

}  // namespace

#include "box_kernels_impl.hpp"

const BoxKernels& avx2_box_kernels() {
  static constexpr BoxKernels kTable = BoxLoops<Avx2Lanes>::table();
  return kTable;
}

}  // namespace piecework::collision
