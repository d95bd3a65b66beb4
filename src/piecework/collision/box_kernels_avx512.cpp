// Kernels for AVX-512.

#include <immintrin.h>

#include "box_kernels.hpp"

namespace piecework::collision {
namespace {

struct Avx512Lanes {
  static __m512i integers(const int* lanes) { return _mm512_loadu_si512(lanes); }
  static unsigned at_most(__m512 a, __m512 b) { return _mm512_cmp_ps_mask(a, b, _CMP_LE_OQ); }

  /// Comparisons first, masks later: chained by masks they would wait for each other.
  static unsigned below(const BoxLanes& boxes, const float* bound, int stride) {
    unsigned in = at_most(_mm512_load_ps(boxes.number[0]), _mm512_set1_ps(bound[0]));
    for (int k = 1; k < kNumbers; ++k)
      in &= at_most(_mm512_load_ps(boxes.number[k]), _mm512_set1_ps(bound[k * stride]));
    return in;
  }
  static unsigned above(const float* box, const BoxLanes& bounds) {
    unsigned in = at_most(_mm512_set1_ps(box[0]), _mm512_load_ps(bounds.number[0]));
    for (int k = 1; k < kNumbers; ++k)
      in &= at_most(_mm512_set1_ps(box[k * kLanes]), _mm512_load_ps(bounds.number[k]));
    return in;
  }
  static unsigned equal(const int* lanes, int number) {
    return _mm512_cmpeq_epi32_mask(integers(lanes), _mm512_set1_epi32(number));
  }
  static unsigned greater(const int* lanes, int number) {
    return _mm512_cmpgt_epi32_mask(integers(lanes), _mm512_set1_epi32(number));
  }
  /// Compressed in a register: straight to memory is slow on some processors.
  static int append(int* end, const int* lanes, unsigned mask) {
    _mm512_storeu_si512(end,
                        _mm512_maskz_compress_epi32(static_cast<__mmask16>(mask), integers(lanes)));
    return __builtin_popcount(mask);
  }
};

}  // namespace

#include "box_kernels_impl.hpp"

const BoxKernels& avx512_box_kernels() {
  static constexpr BoxKernels kTable = BoxLoops<Avx512Lanes>::table();
  return kTable;
}

}  // namespace piecework::collision
