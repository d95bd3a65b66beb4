#pragma once

// Dense column-major matrices in float and double: the few BLAS and LAPACK routines that a
// factorisation needs, by one name for both types, one thread each. Private to the global module.

namespace piecework::global::dense {

/// Keeps OpenBLAS to one thread: parallelism is over fronts and tiles.
void use_one_thread();

/// A = L L^T in the lower triangle of A (n x n). False if a pivot is not positive (or not a
/// number).
template <class T>
bool cholesky(int n, T* a, int lda);

/// B = B L^-T (m x n), L lower triangular n x n.
template <class T>
void solve_right_transposed(int m, int n, const T* l, int ldl, T* b, int ldb);

/// B = B L^-1 (m x n), L lower triangular n x n.
template <class T>
void solve_right(int m, int n, const T* l, int ldl, T* b, int ldb);

/// Lower triangle of C -= A A^T; C n x n, A n x k.
template <class T>
void subtract_square(int n, int k, const T* a, int lda, T* c, int ldc);

/// C -= A B^T; C m x n, A m x k, B n x k.
template <class T>
void subtract_product(int m, int n, int k, const T* a, int lda, const T* b, int ldb, T* c, int ldc);

/// Lower triangle of the inverse of L L^T, from L in the lower triangle of A (n x n).
template <class T>
void invert_from_cholesky(int n, T* a, int lda);

}  // namespace piecework::global::dense
