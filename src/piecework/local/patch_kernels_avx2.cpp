// Kernels for AVX2 and FMA; compiled with those flags, called only where they exist.

#include <immintrin.h>

#include "patch_kernels.hpp"
#include "patch_rows_avx.hpp"

namespace piecework::local {
namespace {

struct Avx2Lanes : AvxRows {
  using V = __m256d;
  using Mask = __m256d;
  static constexpr int kSize = 4;

  static V load(const double* p) { return _mm256_load_pd(p); }
  static V repeat(double number) { return _mm256_set1_pd(number); }
  static V zero() { return _mm256_setzero_pd(); }
  static V add(V a, V b) { return _mm256_add_pd(a, b); }
  static V mul(V a, V b) { return _mm256_mul_pd(a, b); }
  static V div(V a, V b) { return _mm256_div_pd(a, b); }
  static V root(V a) { return _mm256_sqrt_pd(a); }
  static V fma(V a, V b, V c) { return _mm256_fmadd_pd(a, b, c); }
  static V fms(V a, V b, V c) { return _mm256_fmsub_pd(a, b, c); }
  static V fnma(V a, V b, V c) { return _mm256_fnmadd_pd(a, b, c); }
  static double total(V v) { return row_total(v); }

  static Mask usable(V s, V limit, V scale) {
    return _mm256_and_pd(_mm256_cmp_pd(s, limit, _CMP_GT_OQ),
                         _mm256_cmp_pd(scale, repeat(__DBL_MAX__), _CMP_LE_OQ));
  }
  static V keep(Mask mask, V v) { return _mm256_and_pd(mask, v); }
  static unsigned bits(Mask mask) { return static_cast<unsigned>(_mm256_movemask_pd(mask)); }

  /// Four rows as x, y and z of four.
  static void transpose(V r0, V r1, V r2, V r3, V* out) {
    const V t0 = _mm256_unpacklo_pd(r0, r1);
    const V t1 = _mm256_unpackhi_pd(r0, r1);
    const V t2 = _mm256_unpacklo_pd(r2, r3);
    const V t3 = _mm256_unpackhi_pd(r2, r3);
    out[0] = _mm256_permute2f128_pd(t0, t2, 0x20);
    out[1] = _mm256_permute2f128_pd(t1, t3, 0x20);
    out[2] = _mm256_permute2f128_pd(t0, t2, 0x31);
  }

  static void edges(const double* x, const BatchCorners& corners, int first, V* e) {
    V r1[4];
    V r2[4];
    for (int k = 0; k < 4; ++k) {
      const V x0 = load_row(x + corners.corner[0][first + k]);
      r1[k] = _mm256_sub_pd(load_row(x + corners.corner[1][first + k]), x0);
      r2[k] = _mm256_sub_pd(load_row(x + corners.corner[2][first + k]), x0);
    }
    transpose(r1[0], r1[1], r1[2], r1[3], e);
    transpose(r2[0], r2[1], r2[2], r2[3], e + 3);
  }

  static void rows_of(const V* f, V* rows) {
    const V t0 = _mm256_unpacklo_pd(f[0], f[1]);
    const V t1 = _mm256_unpackhi_pd(f[0], f[1]);
    const V u0 = _mm256_unpacklo_pd(f[2], zero());
    const V u1 = _mm256_unpackhi_pd(f[2], zero());
    rows[0] = _mm256_permute2f128_pd(t0, u0, 0x20);
    rows[1] = _mm256_permute2f128_pd(t1, u1, 0x20);
    rows[2] = _mm256_permute2f128_pd(t0, u0, 0x31);
    rows[3] = _mm256_permute2f128_pd(t1, u1, 0x31);
  }

  static void add_forces(const V* f, const BatchCorners& corners, int first, double* force) {
    V r1[4];
    V r2[4];
    rows_of(f, r1);
    rows_of(f + 3, r2);
    for (int k = 0; k < 4; ++k) {
      double* f0 = force + corners.corner[0][first + k];
      double* f1 = force + corners.corner[1][first + k];
      double* f2 = force + corners.corner[2][first + k];
      store_row(f0, _mm256_sub_pd(load_row(f0), _mm256_add_pd(r1[k], r2[k])));
      store_row(f1, _mm256_add_pd(load_row(f1), r1[k]));
      store_row(f2, _mm256_add_pd(load_row(f2), r2[k]));
    }
  }
};

}  // namespace

#include "patch_kernels_impl.hpp"

const PatchKernels& avx2_patch_kernels() {
  static constexpr PatchKernels kTable = PatchLoops<Avx2Lanes>::table();
  return kTable;
}

}  // namespace piecework::local
