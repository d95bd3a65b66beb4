// Rows of four numbers with AVX2 and FMA; included by the sources that are compiled with both.

namespace {

struct AvxRows {
  using Row = __m256d;

  static Row load_row(const double* p) { return _mm256_load_pd(p); }
  static void store_row(double* p, Row v) { _mm256_store_pd(p, v); }
  static Row load3(const double* p) {
    return _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(p)), _mm_load_sd(p + 2), 1);
  }
  static void store3(double* p, Row v) {
    _mm_storeu_pd(p, _mm256_castpd256_pd128(v));
    _mm_store_sd(p + 2, _mm256_extractf128_pd(v, 1));
  }
  static Row repeat_row(const double* p) { return _mm256_broadcast_sd(p); }
  static Row row_add(Row a, Row b) { return _mm256_add_pd(a, b); }
  static Row row_sub(Row a, Row b) { return _mm256_sub_pd(a, b); }
  static Row row_mul(Row a, Row b) { return _mm256_mul_pd(a, b); }
  static Row row_fma(Row a, Row b, Row c) { return _mm256_fmadd_pd(a, b, c); }
  static Row row_fnma(Row a, Row b, Row c) { return _mm256_fnmadd_pd(a, b, c); }
  static Row row_zero() { return _mm256_setzero_pd(); }
  static double row_total(Row v) {
    const __m128d two = _mm_add_pd(_mm256_castpd256_pd128(v), _mm256_extractf128_pd(v, 1));
    return _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)));
  }
  static double norm_sq(Row v) { return row_total(_mm256_mul_pd(v, v)); }
  static double root_of(double number) {
    return _mm_cvtsd_f64(_mm_sqrt_sd(_mm_setzero_pd(), _mm_set_sd(number)));
  }
};

}  // namespace
