#pragma once

// Hot loops of the outer iteration, compiled once per instruction set and chosen at run time.
// Private to `pd`.

#include <cstddef>

#include <piecework/core/isa.hpp>

namespace piecework::pd {

/// Triangles side by side.
inline constexpr int kLanes = 8;
/// Pairs of a triangle's corners: (0,0) (1,0) (1,1) (2,0) (2,1) (2,2).
inline constexpr int kPairs = 6;

struct alignas(64) NormalBatch {
  double inverse[4][kLanes];  ///< Dm^-1, row-major, 1/m
  double weight[kLanes];      ///< w, J; 0: no triangle in this lane
  int vertex[3][kLanes];      ///< 3 * vertex: offset of its coordinates
  int unknown[3][kLanes];     ///< 3 * unknown: offset of its normal, which is 0 for held vertices
};

/// Vectors that are read together: `count` rows of numbers in 32 bits.
struct FloatRows {
  const float* const* row;
  int count;
};

/// Entries of a sparse matrix of 3 x 3 blocks, row after row.
struct BlockEntries {
  const int* begin;      ///< per row, and the end
  const int* offset;     ///< per entry: 3 * column
  const float* numbers;  ///< per entry
};

struct BlockRows {
  BlockEntries dense;   ///< 9 numbers each, column-major, and one number behind the last
  BlockEntries scalar;  ///< 1 number each, times the identity
};

struct OuterKernels {
  /// Per batch kPairs x kLanes numbers
  ///     w [c_T (t_a . n_a)(t_b . n_b) + (G_a^T B G_b)(n . n_a)(n . n_b)],
  /// see NormalMatrix; 0 for degenerate triangles. \param x, normals  rows of three numbers
  void (*normal_pairs)(const NormalBatch* batches, int count, const double* x,
                       const double* normals, double* pairs);

  /// sum[k] = row_k . with over numbers begin ... end - 1.
  void (*products)(const FloatRows& rows, const double* with, std::size_t begin, std::size_t end,
                   double* sum);

  /// out = factor base + sum_k weight[k] row_k; out may be base.
  void (*combine)(double factor, const double* base, const FloatRows& rows, const double* weight,
                  std::size_t begin, std::size_t end, double* out);

  /// s = step d, y = after - before, rounded to 32 bits.
  void (*difference)(double step, const double* d, const double* before, const double* after,
                     std::size_t begin, std::size_t end, float* s, float* y);

  /// sum[k] = row_k . y and with_after[k] = row_k . after.
  void (*two_products)(const FloatRows& rows, const float* y, const double* after,
                       std::size_t begin, std::size_t end, double* with_y, double* with_after);

  /// Rows begin ... end - 1 of y = A x; x, y: three numbers per row.
  void (*block_product)(const BlockRows& rows, const double* x, std::size_t begin, std::size_t end,
                        double* y);

  /// a . b.
  double (*dot)(const double* a, const double* b, std::size_t begin, std::size_t end);
};

/// \pre this processor runs `isa`.
const OuterKernels& outer_kernels(Isa isa);

const OuterKernels& portable_outer_kernels();
const OuterKernels& avx2_outer_kernels();
const OuterKernels& avx512_outer_kernels();

}  // namespace piecework::pd
