#pragma once

// Dense column-major matrices in float and double: the few BLAS and LAPACK routines that a
// factorisation needs, by one name for both types, one thread each. Private to the global module.

namespace piecework::global::dense {

/// Keeps OpenBLAS to one thread: parallelism is over fronts and tiles.
void use_one_thread();

/// Lower triangle of C -= A A^T; C n x n, A n x k.
template <class T>
void subtract_square(int n, int k, const T* a, int lda, T* c, int ldc);

/// C -= A B^T; C m x n, A m x k, B n x k.
template <class T>
void subtract_product(int m, int n, int k, const T* a, int lda, const T* b, int ldb, T* c, int ldc);

}  // namespace piecework::global::dense
