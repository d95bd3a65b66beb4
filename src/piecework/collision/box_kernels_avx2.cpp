// Kernels for AVX2; compiled with that flag, called only where it exists.

#include <immintrin.h>

#include "box_kernels.hpp"

namespace piecework::collision {
namespace {

struct Avx2Lanes {
  static __m256i numbers(const short* lanes) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(lanes));
  }
  /// Bits of the lanes that are zero; the others have all bits set.
  static unsigned bits_of_zeros(__m256i lanes) {
    const __m128i bytes =
        _mm_packs_epi16(_mm256_castsi256_si128(lanes), _mm256_extracti128_si256(lanes, 1));
    return static_cast<unsigned>(_mm_movemask_epi8(bytes)) ^ 0xffffU;
  }

  static unsigned below(const BoxLanes& boxes, const short* bound, int stride) {
    __m256i out = _mm256_setzero_si256();
    for (int k = 0; k < kNumbers; ++k)
      out = _mm256_or_si256(
          out, _mm256_cmpgt_epi16(numbers(boxes.number[k]), _mm256_set1_epi16(bound[k * stride])));
    return bits_of_zeros(out);
  }
  static unsigned above(const short* box, const BoxLanes& bounds) {
    __m256i out = _mm256_setzero_si256();
    for (int k = 0; k < kNumbers; ++k)
      out = _mm256_or_si256(
          out, _mm256_cmpgt_epi16(_mm256_set1_epi16(box[k * kLanes]), numbers(bounds.number[k])));
    return bits_of_zeros(out);
  }

  static __m256i integers(const int* lanes) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(lanes));
  }
  static unsigned bits(__m256i first, __m256i second) {
    return static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(first)) |
                                 _mm256_movemask_ps(_mm256_castsi256_ps(second)) << 8);
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
