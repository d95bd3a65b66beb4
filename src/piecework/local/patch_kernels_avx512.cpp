// Kernels for AVX-512 (F, DQ, VL, BW); compiled with those flags, called only where they exist.

#include <immintrin.h>

#include "patch_kernels.hpp"
#include "patch_rows_avx.hpp"

namespace piecework::local {
namespace {

struct Avx512Lanes : AvxRows {
  using V = __m512d;
  using Mask = __mmask8;
  static constexpr int kSize = 8;

  static V load(const double* p) { return _mm512_load_pd(p); }
  static V repeat(double number) { return _mm512_set1_pd(number); }
  static V zero() { return _mm512_setzero_pd(); }
  static V add(V a, V b) { return _mm512_add_pd(a, b); }
  static V mul(V a, V b) { return _mm512_mul_pd(a, b); }
  static V div(V a, V b) { return _mm512_div_pd(a, b); }
  static V root(V a) { return _mm512_sqrt_pd(a); }
  static V fma(V a, V b, V c) { return _mm512_fmadd_pd(a, b, c); }
  static V fms(V a, V b, V c) { return _mm512_fmsub_pd(a, b, c); }
  static V fnma(V a, V b, V c) { return _mm512_fnmadd_pd(a, b, c); }
  static double total(V v) {
    return row_total(_mm256_add_pd(_mm512_castpd512_pd256(v), _mm512_extractf64x4_pd(v, 1)));
  }

  static Mask usable(V s, V limit, V scale) {
    return _mm512_mask_cmp_pd_mask(_mm512_cmp_pd_mask(s, limit, _CMP_GT_OQ), scale,
                                   repeat(__DBL_MAX__), _CMP_LE_OQ);
  }
  static V keep(Mask mask, V v) { return _mm512_maskz_mov_pd(mask, v); }
  static unsigned bits(Mask mask) { return mask; }

  /// Rows of lanes k and k + 4.
  static V load_pair(const double* x, const RowOffset* corner, int k) {
    return _mm512_insertf64x4(_mm512_castpd256_pd512(load_row(x + corner[k])),
                              load_row(x + corner[k + 4]), 1);
  }

  /// Four such pairs as x, y and z of eight.
  static void transpose(const V* r, V* out) {
    const V t0 = _mm512_unpacklo_pd(r[0], r[1]);
    const V t1 = _mm512_unpackhi_pd(r[0], r[1]);
    const V t2 = _mm512_unpacklo_pd(r[2], r[3]);
    const V t3 = _mm512_unpackhi_pd(r[2], r[3]);
    const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
    const __m512i high = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
    out[0] = _mm512_permutex2var_pd(t0, low, t2);
    out[1] = _mm512_permutex2var_pd(t1, low, t3);
    out[2] = _mm512_permutex2var_pd(t0, high, t2);
  }

  static void edges(const double* x, const BatchCorners& corners, int /*first*/, V* e) {
    V r1[4];
    V r2[4];
    for (int k = 0; k < 4; ++k) {
      const V x0 = load_pair(x, corners.corner[0], k);
      r1[k] = _mm512_sub_pd(load_pair(x, corners.corner[1], k), x0);
      r2[k] = _mm512_sub_pd(load_pair(x, corners.corner[2], k), x0);
    }
    transpose(r1, e);
    transpose(r2, e + 3);
  }

  /// The inverse of transpose().
  static void rows_of(const V* f, V* r) {
    const V t0 = _mm512_unpacklo_pd(f[0], f[1]);
    const V t1 = _mm512_unpackhi_pd(f[0], f[1]);
    const V u0 = _mm512_unpacklo_pd(f[2], zero());
    const V u1 = _mm512_unpackhi_pd(f[2], zero());
    const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
    const __m512i high = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
    r[0] = _mm512_permutex2var_pd(t0, low, u0);
    r[1] = _mm512_permutex2var_pd(t1, low, u1);
    r[2] = _mm512_permutex2var_pd(t0, high, u0);
    r[3] = _mm512_permutex2var_pd(t1, high, u1);
  }

  static void add_row(double* f, Row row) { store_row(f, _mm256_add_pd(load_row(f), row)); }

  static void add_pair(double* force, const RowOffset* corner, int k, V pair) {
    add_row(force + corner[k], _mm512_castpd512_pd256(pair));
    add_row(force + corner[k + 4], _mm512_extractf64x4_pd(pair, 1));
  }

  static void add_forces(const V* f, const BatchCorners& corners, int /*first*/, double* force) {
    V r1[4];
    V r2[4];
    rows_of(f, r1);
    rows_of(f + 3, r2);
    for (int k = 0; k < 4; ++k) {
      add_pair(force, corners.corner[0], k, _mm512_sub_pd(zero(), _mm512_add_pd(r1[k], r2[k])));
      add_pair(force, corners.corner[1], k, r1[k]);
      add_pair(force, corners.corner[2], k, r2[k]);
    }
  }
};

}  // namespace

#include "patch_kernels_impl.hpp"

const PatchKernels& avx512_patch_kernels() {
  static constexpr PatchKernels kTable = PatchLoops<Avx512Lanes>::table();
  return kTable;
}

}  // namespace piecework::local
