// Kernels for AVX2; compiled with that flag, called only where it exists.

#include <immintrin.h>

#include "box_kernels.hpp"

namespace piecework::collision {
namespace {

struct Avx2Lanes {
  static __m256 at_most(__m256 a, __m256 b) { return _mm256_cmp_ps(a, b, _CMP_LE_OQ); }
  static unsigned bits(__m256 first, __m256 second) {
    return static_cast<unsigned>(_mm256_movemask_ps(first) | _mm256_movemask_ps(second) << 8);
  }

  static unsigned below(const BoxLanes& boxes, const float* bound, int stride) {
    const __m256 b0 = _mm256_broadcast_ss(bound);
    __m256 in0 = at_most(_mm256_load_ps(boxes.number[0]), b0);
    __m256 in1 = at_most(_mm256_load_ps(boxes.number[0] + 8), b0);
    for (int k = 1; k < kNumbers; ++k) {
      const __m256 b = _mm256_broadcast_ss(bound + k * stride);
      in0 = _mm256_and_ps(in0, at_most(_mm256_load_ps(boxes.number[k]), b));
      in1 = _mm256_and_ps(in1, at_most(_mm256_load_ps(boxes.number[k] + 8), b));
    }
    return bits(in0, in1);
  }
  static unsigned above(const float* box, const BoxLanes& bounds) {
    const __m256 n0 = _mm256_broadcast_ss(box);
    __m256 in0 = at_most(n0, _mm256_load_ps(bounds.number[0]));
    __m256 in1 = at_most(n0, _mm256_load_ps(bounds.number[0] + 8));
    for (int k = 1; k < kNumbers; ++k) {
      const __m256 n = _mm256_broadcast_ss(box + k * kLanes);
      in0 = _mm256_and_ps(in0, at_most(n, _mm256_load_ps(bounds.number[k])));
      in1 = _mm256_and_ps(in1, at_most(n, _mm256_load_ps(bounds.number[k] + 8)));
    }
    return bits(in0, in1);
  }

  static __m256i integers(const int* lanes) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(lanes));
  }
  static unsigned bits(__m256i first, __m256i second) {
    return bits(_mm256_castsi256_ps(first), _mm256_castsi256_ps(second));
  }
  static unsigned equal(const int* lanes, int number) {
    const __m256i n = _mm256_set1_epi32(number);
    return bits(_mm256_cmpeq_epi32(integers(lanes), n), _mm256_cmpeq_epi32(integers(lanes + 8), n));
  }
  static unsigned greater(const int* lanes, int number) {
    const __m256i n = _mm256_set1_epi32(number);
    return bits(_mm256_cmpgt_epi32(integers(lanes), n), _mm256_cmpgt_epi32(integers(lanes + 8), n));
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
