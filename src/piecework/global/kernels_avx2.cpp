// Kernels for AVX2 and FMA; compiled with those flags, called only where they exist.

#include <immintrin.h>

#include "kernels.hpp"

namespace piecework::global {
namespace {

/// All bits set in the first n of 8 (or, read from further in, of 4 double) places.
alignas(64) constexpr int kMask[16] = {-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0};

struct Float8 {
  using Number = float;
  using V = __m256;
  static constexpr int kSize = 8;
  static constexpr int kStrip = 4;

  static V load(const float* p) { return _mm256_loadu_ps(p); }
  static void store(float* p, V v) { _mm256_storeu_ps(p, v); }
  static __m256i first(int n) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kMask + 8 - n));  // NOLINT
  }
  static V load_some(const float* p, int n) { return _mm256_maskload_ps(p, first(n)); }
  static void store_some(float* p, V v, int n) { _mm256_maskstore_ps(p, first(n), v); }
  static V repeat(float number) { return _mm256_set1_ps(number); }
  static V fma(V a, V b, V c) { return _mm256_fmadd_ps(a, b, c); }
  static V add(V a, V b) { return _mm256_add_ps(a, b); }
  static V zero() { return _mm256_setzero_ps(); }
  static V mul(V a, V b) { return _mm256_mul_ps(a, b); }
  static V negative(V a) { return _mm256_sub_ps(zero(), a); }
  static float root(float number) { return _mm_cvtss_f32(_mm_sqrt_ss(_mm_set_ss(number))); }
  static constexpr float kHuge = __FLT_MAX__;

  template <int K>
  __attribute__((always_inline)) static inline void sum(const V (&v)[K], float* out) {
    for (int k = 0; k < K; ++k) {
      const __m128 four = _mm_add_ps(_mm256_castps256_ps128(v[k]), _mm256_extractf128_ps(v[k], 1));
      const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
      out[k] = _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)));
    }
  }
};

struct Double4 {
  using Number = double;
  using V = __m256d;
  static constexpr int kSize = 4;
  static constexpr int kStrip = 4;

  static V load(const double* p) { return _mm256_loadu_pd(p); }
  static void store(double* p, V v) { _mm256_storeu_pd(p, v); }
  static __m256i first(int n) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kMask + 8 - 2 * n));  // NOLINT
  }
  static V load_some(const double* p, int n) { return _mm256_maskload_pd(p, first(n)); }
  static void store_some(double* p, V v, int n) { _mm256_maskstore_pd(p, first(n), v); }
  static V repeat(double number) { return _mm256_set1_pd(number); }
  static V fma(V a, V b, V c) { return _mm256_fmadd_pd(a, b, c); }
  static V add(V a, V b) { return _mm256_add_pd(a, b); }
  static V zero() { return _mm256_setzero_pd(); }
  static V mul(V a, V b) { return _mm256_mul_pd(a, b); }
  static V negative(V a) { return _mm256_sub_pd(zero(), a); }
  static double root(double number) {
    return _mm_cvtsd_f64(_mm_sqrt_sd(_mm_setzero_pd(), _mm_set_sd(number)));
  }
  static constexpr double kHuge = __DBL_MAX__;

  template <int K>
  __attribute__((always_inline)) static inline void sum(const V (&v)[K], double* out) {
    for (int k = 0; k < K; ++k) {
      const __m128d two = _mm_add_pd(_mm256_castpd256_pd128(v[k]), _mm256_extractf128_pd(v[k], 1));
      out[k] = _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)));
    }
  }
};

}  // namespace

#include "kernels_impl.hpp"

template <>
const Kernels<float>& avx2_kernels<float>() {
  static constexpr Kernels<float> table = kernels_of<Float8>();
  return table;
}

template <>
const Kernels<double>& avx2_kernels<double>() {
  static constexpr Kernels<double> table = kernels_of<Double4>();
  return table;
}

}  // namespace piecework::global
