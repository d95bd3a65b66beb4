// Kernels for AVX-512 with 256-bit vectors: masks, and lanes written by one instruction.

#include <immintrin.h>

#include "box_kernels.hpp"

namespace piecework::collision {
namespace {

struct Avx512Lanes {
  static __m256i integers(const int* lanes) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(lanes));
  }

  static unsigned below(const BoxLanes& boxes, const float* bound, int stride) {
    __mmask8 in = 0xff;
    for (int k = 0; k < kNumbers; ++k)
      in = _mm256_mask_cmp_ps_mask(in, _mm256_load_ps(boxes.number[k]),
                                   _mm256_broadcast_ss(bound + k * stride), _CMP_LE_OQ);
    return in;
  }
  static unsigned above(const float* box, const BoxLanes& bounds) {
    __mmask8 in = 0xff;
    for (int k = 0; k < kNumbers; ++k)
      in = _mm256_mask_cmp_ps_mask(in, _mm256_broadcast_ss(box + k * kLanes),
                                   _mm256_load_ps(bounds.number[k]), _CMP_LE_OQ);
    return in;
  }
  static unsigned equal(const int* lanes, int number) {
    return _mm256_cmpeq_epi32_mask(integers(lanes), _mm256_set1_epi32(number));
  }
  static unsigned greater(const int* lanes, int number) {
    return _mm256_cmpgt_epi32_mask(integers(lanes), _mm256_set1_epi32(number));
  }
  /// Compressed in a register: straight to memory is slow on some processors.
  static int append(int* end, const int* lanes, unsigned mask) {
    const __m256i packed =
        _mm256_maskz_compress_epi32(static_cast<__mmask8>(mask), integers(lanes));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(end), packed);
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
