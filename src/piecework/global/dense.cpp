#include "dense.hpp"

#include <cblas.h>

// LAPACK, from OpenBLAS.
extern "C" {
void openblas_set_num_threads(int threads);
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void spotrf_(const char* uplo, const int* n, float* a, const int* lda, int* info);
void dpotri_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void spotri_(const char* uplo, const int* n, float* a, const int* lda, int* info);
}

namespace piecework::global::dense {
namespace {

void trsm(CBLAS_TRANSPOSE trans, int m, int n, const double* l, int ldl, double* b, int ldb) {
  cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, trans, CblasNonUnit, m, n, 1.0, l, ldl, b,
              ldb);
}

void trsm(CBLAS_TRANSPOSE trans, int m, int n, const float* l, int ldl, float* b, int ldb) {
  cblas_strsm(CblasColMajor, CblasRight, CblasLower, trans, CblasNonUnit, m, n, 1.0F, l, ldl, b,
              ldb);
}

}  // namespace

void use_one_thread() { openblas_set_num_threads(1); }

template <>
bool cholesky<double>(int n, double* a, int lda) {
  int info = 0;
  dpotrf_("L", &n, a, &lda, &info);
  return info == 0;
}

template <>
bool cholesky<float>(int n, float* a, int lda) {
  int info = 0;
  spotrf_("L", &n, a, &lda, &info);
  return info == 0;
}

template <class T>
void solve_right_transposed(int m, int n, const T* l, int ldl, T* b, int ldb) {
  trsm(CblasTrans, m, n, l, ldl, b, ldb);
}

template <class T>
void solve_right(int m, int n, const T* l, int ldl, T* b, int ldb) {
  trsm(CblasNoTrans, m, n, l, ldl, b, ldb);
}

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

template <>
void invert_from_cholesky<double>(int n, double* a, int lda) {
  int info = 0;
  dpotri_("L", &n, a, &lda, &info);
}

template <>
void invert_from_cholesky<float>(int n, float* a, int lda) {
  int info = 0;
  spotri_("L", &n, a, &lda, &info);
}

template void solve_right_transposed<double>(int, int, const double*, int, double*, int);
template void solve_right_transposed<float>(int, int, const float*, int, float*, int);
template void solve_right<double>(int, int, const double*, int, double*, int);
template void solve_right<float>(int, int, const float*, int, float*, int);

}  // namespace piecework::global::dense
