// Kernels for AVX-512 (F, DQ, VL, BW); compiled with those flags, called only where they exist.

#include <immintrin.h>

#include "kernels.hpp"

namespace piecework::global {
namespace {

struct Float16 {
  using Number = float;
  using V = __m512;
  static constexpr int kSize = 16;
  static constexpr int kStrip = 8;

  static V load(const float* p) { return _mm512_loadu_ps(p); }
  static void store(float* p, V v) { _mm512_storeu_ps(p, v); }
  static __mmask16 first(int n) { return static_cast<__mmask16>((1U << n) - 1U); }
  static V load_some(const float* p, int n) { return _mm512_maskz_loadu_ps(first(n), p); }
  static void store_some(float* p, V v, int n) { _mm512_mask_storeu_ps(p, first(n), v); }
  static V repeat(float number) { return _mm512_set1_ps(number); }
  static V fma(V a, V b, V c) { return _mm512_fmadd_ps(a, b, c); }
  static V add(V a, V b) { return _mm512_add_ps(a, b); }
  static V zero() { return _mm512_setzero_ps(); }
  static V mul(V a, V b) { return _mm512_mul_ps(a, b); }
  static V negative(V a) { return _mm512_sub_ps(zero(), a); }
  static float root(float number) { return _mm_cvtss_f32(_mm_sqrt_ss(_mm_set_ss(number))); }
  static constexpr float kHuge = __FLT_MAX__;

  /// Sums of four vectors, each as four partial sums in one group of lanes.
  static V sum_four(V a, V b, V c, V d) {
    const V ab = add(_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
    const V cd = add(_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
    const __m512d p = _mm512_castps_pd(ab);
    const __m512d q = _mm512_castps_pd(cd);
    return add(_mm512_castpd_ps(_mm512_unpacklo_pd(p, q)),
               _mm512_castpd_ps(_mm512_unpackhi_pd(p, q)));
  }

  template <int K>
  __attribute__((always_inline)) static inline void sum(const V (&v)[K], float* out) {
    const auto get = [&](int k) __attribute__((always_inline)) {
      return k < K ? v[k < K ? k : 0] : zero();
    };
    const V q0 = sum_four(get(0), get(1), get(2), get(3));
    if constexpr (K <= 4) {
      const __m256 half = _mm256_add_ps(_mm512_castps512_ps256(q0), _mm512_extractf32x8_ps(q0, 1));
      const __m128 total = _mm_add_ps(_mm256_castps256_ps128(half), _mm256_extractf128_ps(half, 1));
      _mm_mask_storeu_ps(out, static_cast<__mmask8>((1U << K) - 1U), total);
    } else {
      const V q1 = sum_four(get(4), get(5), get(6), get(7));
      const V s = add(_mm512_shuffle_f32x4(q0, q1, 0x88), _mm512_shuffle_f32x4(q0, q1, 0xDD));
      const V t = add(_mm512_shuffle_f32x4(s, s, 0x08), _mm512_shuffle_f32x4(s, s, 0x0D));
      _mm256_mask_storeu_ps(out, static_cast<__mmask8>((1U << K) - 1U), _mm512_castps512_ps256(t));
    }
  }
};

struct Double8 {
  using Number = double;
  using V = __m512d;
  static constexpr int kSize = 8;
  static constexpr int kStrip = 8;

  static V load(const double* p) { return _mm512_loadu_pd(p); }
  static void store(double* p, V v) { _mm512_storeu_pd(p, v); }
  static __mmask8 first(int n) { return static_cast<__mmask8>((1U << n) - 1U); }
  static V load_some(const double* p, int n) { return _mm512_maskz_loadu_pd(first(n), p); }
  static void store_some(double* p, V v, int n) { _mm512_mask_storeu_pd(p, first(n), v); }
  static V repeat(double number) { return _mm512_set1_pd(number); }
  static V fma(V a, V b, V c) { return _mm512_fmadd_pd(a, b, c); }
  static V add(V a, V b) { return _mm512_add_pd(a, b); }
  static V zero() { return _mm512_setzero_pd(); }
  static V mul(V a, V b) { return _mm512_mul_pd(a, b); }
  static V negative(V a) { return _mm512_sub_pd(zero(), a); }
  static double root(double number) {
    return _mm_cvtsd_f64(_mm_sqrt_sd(_mm_setzero_pd(), _mm_set_sd(number)));
  }
  static constexpr double kHuge = __DBL_MAX__;

  template <int K>
  __attribute__((always_inline)) static inline void sum(const V (&v)[K], double* out) {
    const auto get = [&](int k) __attribute__((always_inline)) {
      return k < K ? v[k < K ? k : 0] : zero();
    };
    const auto pair = [](V a, V b) {
      return add(_mm512_unpacklo_pd(a, b), _mm512_unpackhi_pd(a, b));
    };
    const auto four = [](V a, V b) {
      return add(_mm512_shuffle_f64x2(a, b, 0x88), _mm512_shuffle_f64x2(a, b, 0xDD));
    };
    const V s0 = four(pair(get(0), get(1)), pair(get(2), get(3)));
    const V s1 = K > 4 ? four(pair(get(4), get(5)), pair(get(6), get(7))) : zero();
    _mm512_mask_storeu_pd(out, static_cast<__mmask8>((1U << K) - 1U), four(s0, s1));
  }
};

}  // namespace

#include "kernels_impl.hpp"

template <>
const Kernels<float>& avx512_kernels<float>() {
  static constexpr Kernels<float> table = kernels_of<Float16>();
  return table;
}

template <>
const Kernels<double>& avx512_kernels<double>() {
  static constexpr Kernels<double> table = kernels_of<Double8>();
  return table;
}

}  // namespace piecework::global
