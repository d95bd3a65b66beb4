#include "dense.hpp"

#include <cblas.h>

extern "C" void openblas_set_num_threads(int threads);

namespace piecework::global::dense {

void use_one_thread() { openblas_set_num_threads(1); }

template <>
void subtract_square<double>(int n, int k, const double* a, int lda, double* c, int ldc) {
  cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, n, k, -1.0, a, lda, 1.0, c, ldc);
}

template <>
void subtract_square<float>(int n, int k, const float* a, int lda, float* c, int ldc) {
  cblas_ssyrk(CblasColMajor, CblasLower, CblasNoTrans, n, k, -1.0F, a, lda, 1.0F, c, ldc);
}

template <>
void subtract_product<double>(int m, int n, int k, const double* a, int lda, const double* b,
                              int ldb, double* c, int ldc) {
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, m, n, k, -1.0, a, lda, b, ldb, 1.0, c, ldc);
}

template <>
void subtract_product<float>(int m, int n, int k, const float* a, int lda, const float* b, int ldb,
                             float* c, int ldc) {
  cblas_sgemm(CblasColMajor, CblasNoTrans, CblasTrans, m, n, k, -1.0F, a, lda, b, ldb, 1.0F, c,
              ldc);
}

}  // namespace piecework::global::dense
