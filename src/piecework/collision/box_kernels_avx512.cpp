// Kernels for AVX-512.

#include <immintrin.h>

#include "box_kernels.hpp"

namespace piecework::collision {
namespace {

struct Avx512Lanes {
  static __m512i integers(const int* lanes) { return _mm512_loadu_si512(lanes); }
  static __m256i numbers(const short* lanes) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(lanes));
  }

  static unsigned below(const BoxLanes& boxes, const short* bound, int stride) {
    unsigned in = 0xffff;
    for (int k = 0; k < kNumbers; ++k)
      in &= _mm256_cmple_epi16_mask(numbers(boxes.number[k]), _mm256_set1_epi16(bound[k * stride]));
    return in;
  }
  static unsigned above(const short* box, const BoxLanes& bounds) {
    unsigned in = 0xffff;
    for (int k = 0; k < kNumbers; ++k)
      in &= _mm256_cmple_epi16_mask(_mm256_set1_epi16(box[k * kLanes]), numbers(bounds.number[k]));
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
