#pragma once

// The dense work of a triangular solve, compiled once per instruction set and chosen at run time.
// Private to the global module.
//
// A panel is a block of columns of the factor in block LDL^T form: D^-1 of the columns themselves
// ("own") and -B below, with B = L_below L_own^-1. Both parts are stored in strips of columns; a
// strip holds chunks of as many rows as a vector has numbers, and in a chunk the columns follow
// each other (the last chunk has fewer rows; nothing is padded but strips, to 64 bytes). So a sweep
// in either direction reads each part front to back, without gathering or transposing, and with all
// sums of a strip in registers.
//
// Vectors hold their right-hand sides ("lanes") one after the other: number r of lane l is at
// v[r + l * stride].

#include <cstddef>

#include <piecework/global/isa.hpp>

namespace piecework::global {

/// Consecutive rows of a vector.
struct RowRun {
  int start;
  int length;
};

/// A vector with its lanes.
template <class T>
struct Lanes {
  T* data;
  std::ptrdiff_t stride;
  [[nodiscard]] Lanes at(std::ptrdiff_t row) const { return {data + row, stride}; }
};

/// A panel, or some of its rows below.
template <class T>
struct PanelView {
  const T* own;    ///< cols x cols
  const T* below;  ///< rows x cols
  int cols;
  int rows;       ///< below
  int first_row;  ///< forward() starts with this row below ...
  int num_rows;   ///< ... and does so many; a multiple of the chunk except at the end
  bool inverse;   ///< "own" is D^-1; false: backward() leaves it out
  bool fresh;     ///< what forward() adds to is zero, whatever the memory says
};

/// Sweeps over panels for one number of lanes.
template <class T>
struct SweepKernels {
  /// below += P x for the rows below of the view; x: cols rows. Writes whole vectors: after the
  /// last row, each lane has room for kSlack numbers that nobody uses.
  void (*forward)(const PanelView<T>& panel, const Lanes<T>& x, const Lanes<T>& below);
  /// y = own^T x_own + P^T x_below for the strips first_strip ... end_strip - 1, all rows below.
  /// y, of which the strips' rows are written, must not overlap x_own.
  void (*backward)(const PanelView<T>& panel, int first_strip, int end_strip, const Lanes<T>& x_own,
                   const Lanes<T>& x_below, const Lanes<T>& y);
  /// out = the rows of all runs, one after the other.
  void (*gather)(const Lanes<T>& vector, const RowRun* runs, int num_runs, const Lanes<T>& out);
  /// vector += in, at the rows of all runs.
  void (*scatter_add)(const Lanes<T>& vector, const RowRun* runs, int num_runs, const Lanes<T>& in);
};

/// Numbers by which the lanes of a vector are longer than its rows.
inline constexpr int kSlack = 16;

/// How many right-hand sides go through a sweep together.
inline constexpr int kMaxLanes = 3;

/// Small dense column-major matrices of a factorisation; columns start at multiples of 64 bytes.
template <class T>
struct DenseKernels {
  /// Cholesky factorisation of columns first ... last - 1 of a matrix of which the lower triangle
  /// is given and the columns before are done: L in those columns, and columns last ... end - 1
  /// less what L takes from them. Entries above the diagonal are void afterwards. False if a pivot
  /// is not positive or not finite.
  bool (*eliminate)(T* a, int rows, int ld, int first, int last, int end);
  /// X = L^-1 of lower triangular L (width x width); X: whole chunks of rows are written, zero
  /// above the diagonal.
  void (*invert)(const T* l, int ldl, int width, T* x, int ldx);
  /// -A X for lower triangular X (width x width, zero above the diagonal); A: rows x width. `out`
  /// has the layout of a panel's block for numbers of this type.
  void (*multiply)(const T* a, int lda, int rows, const T* x, int ldx, int width, T* out);
  /// Z = Y^T Y in full for lower triangular Y (width x width, zero above the diagonal; whole chunks
  /// of rows are read and written). `work`: ldy * width numbers.
  void (*square)(const T* y, int ldy, int width, T* z, int ldz, T* work);
  /// The lower triangle of B is added to A where the runs put its rows and columns.
  void (*extend_add)(T* a, int lda, const T* b, int ldb, const RowRun* runs, int num_runs);
};

/// How panels are stored for an instruction set.
struct PanelLayout {
  int strip_cols;
  int chunk_rows;
  int alignment;  ///< numbers in 64 bytes

  [[nodiscard]] std::size_t aligned(std::size_t numbers) const {
    const auto quantum = static_cast<std::size_t>(alignment);
    return (numbers + quantum - 1) / quantum * quantum;
  }
  /// Numbers that a block of `rows` x `cols` takes.
  [[nodiscard]] std::size_t block_size(int rows, int cols) const {
    const auto r = static_cast<std::size_t>(rows);
    const auto full = static_cast<std::size_t>(cols / strip_cols);
    const auto rest = static_cast<std::size_t>(cols % strip_cols);
    return full * aligned(r * static_cast<std::size_t>(strip_cols)) + aligned(r * rest);
  }
  [[nodiscard]] int num_strips(int own) const { return (own + strip_cols - 1) / strip_cols; }
};

/// What one instruction set offers for numbers of type T.
template <class T>
struct Kernels {
  PanelLayout layout;
  SweepKernels<T> one;    ///< one right-hand side
  SweepKernels<T> three;  ///< up to three
  DenseKernels<T> dense;
};

/// \pre this processor runs `isa`.
template <class T>
const Kernels<T>& kernels(Isa isa);

template <class T>
const Kernels<T>& portable_kernels();
template <class T>
const Kernels<T>& avx2_kernels();
template <class T>
const Kernels<T>& avx512_kernels();

}  // namespace piecework::global
