// The sweeps, written once over a type of vectors; included by one source file per instruction set.
// No inline function or template of another header is called here: such code, compiled for AVX-512,
// could be chosen by the linker for everyone.
//
// A type of vectors S has: Number, V, kSize (numbers per vector), kStrip (columns per strip), load,
// store, load_some(p, n), store_some(p, v, n) for n <= kSize, repeat(number), fma, add, mul,
// negative, zero, root(number) and sum<K>(v, out): out[k] = the sum of the numbers of v[k].

namespace {

template <int kIndex>
struct Constant {
  constexpr operator int() const { return kIndex; }  // NOLINT(google-explicit-constructor)
};

/// body(0), ..., body(kCount - 1) with constant arguments: arrays indexed by them stay in
/// registers, which no compiler does reliably for a loop.
template <int kCount, int kIndex = 0, class Body>
__attribute__((always_inline)) inline void unroll(const Body& body) {
  if constexpr (kIndex < kCount) {
    body(Constant<kIndex>());
    unroll<kCount, kIndex + 1>(body);
  }
}

#define PIECEWORK_INLINE __attribute__((always_inline))

template <class S, int kLanes>
struct Sweep {
  using T = typename S::Number;
  using V = typename S::V;
  static constexpr int kSize = S::kSize;
  static constexpr int kStrip = S::kStrip;

  static long aligned(long numbers) {
    constexpr long kQuantum = 64 / static_cast<long>(sizeof(T));
    return (numbers + kQuantum - 1) / kQuantum * kQuantum;
  }

  /// One strip of K columns. From the last number of the block to the first: so the whole forward
  /// sweep runs backwards through memory, which prefetchers follow as well as they follow the
  /// backward sweep forwards. Whole vectors of `below` are written even at its end, where missing
  /// rows of the block count as zero: a load after a store of fewer numbers would have to wait.
  template <int K, bool kFresh>
  static void forward_strip(const T* block, int rows, const T* x, long x_stride, T* below,
                            long below_stride) {
    V xs[K][kLanes];
    unroll<K>([&](auto c) PIECEWORK_INLINE {
      unroll<kLanes>([&](auto l) PIECEWORK_INLINE { xs[c][l] = S::repeat(x[c + l * x_stride]); });
    });
    int r = rows / kSize * kSize;
    block += static_cast<long>(K) * r;
    const auto begin = [&](auto l) PIECEWORK_INLINE {
      if constexpr (kFresh) return S::zero();
      return S::load(below + r + l * below_stride);
    };
    if (const int rest = rows - r; rest > 0) {
      V sum[kLanes];
      unroll<kLanes>([&](auto l) PIECEWORK_INLINE { sum[l] = begin(l); });
      unroll<K>([&](auto i) PIECEWORK_INLINE {
        constexpr int c = K - 1 - i;
        const V a = S::load_some(block + c * rest, rest);
        unroll<kLanes>([&](auto l) PIECEWORK_INLINE { sum[l] = S::fma(a, xs[c][l], sum[l]); });
      });
      unroll<kLanes>([&](auto l)
                         PIECEWORK_INLINE { S::store(below + r + l * below_stride, sum[l]); });
    }
    while ((r -= kSize) >= 0) {
      block -= K * kSize;
      V sum[kLanes];
      unroll<kLanes>([&](auto l) PIECEWORK_INLINE { sum[l] = begin(l); });
      unroll<K>([&](auto i) PIECEWORK_INLINE {
        constexpr int c = K - 1 - i;
        const V a = S::load(block + c * kSize);
        unroll<kLanes>([&](auto l) PIECEWORK_INLINE { sum[l] = S::fma(a, xs[c][l], sum[l]); });
      });
      unroll<kLanes>([&](auto l)
                         PIECEWORK_INLINE { S::store(below + r + l * below_stride, sum[l]); });
    }
  }

  template <int K>
  static void forward_last(int cols, const T* block, const PanelView<T>& panel, const T* x,
                           long x_stride, T* below, long below_stride) {
    if constexpr (K > 0) {
      if (cols != K)
        forward_last<K - 1>(cols, block, panel, x, x_stride, below, below_stride);
      else if (panel.fresh)
        forward_strip<K, true>(block, panel.num_rows, x, x_stride, below, below_stride);
      else
        forward_strip<K, false>(block, panel.num_rows, x, x_stride, below, below_stride);
    }
  }

  static void forward(const PanelView<T>& panel, const Lanes<T>& x, const Lanes<T>& below) {
    T* out = below.data + panel.first_row;
    const long strip = aligned(static_cast<long>(kStrip) * panel.rows);
    int c = (panel.cols - 1) / kStrip * kStrip;  // the last strip comes first
    const int cols = panel.cols - c;
    const T* block = panel.below + c / kStrip * strip;
    forward_last<kStrip>(cols, block + static_cast<long>(cols) * panel.first_row, panel, x.data + c,
                         x.stride, out, below.stride);
    while ((c -= kStrip) >= 0) {
      block -= strip;
      forward_strip<kStrip, false>(block + static_cast<long>(kStrip) * panel.first_row,
                                   panel.num_rows, x.data + c, x.stride, out, below.stride);
    }
  }

  template <int K>
  struct Sums {
    V v[kLanes][K];
  };

  template <int K>
  PIECEWORK_INLINE static inline void add_block(const T* block, int rows, const T* x, long x_stride,
                                                Sums<K>& sums) {
    int r = 0;
    for (; r + kSize <= rows; r += kSize) {
      V xr[kLanes];
      unroll<kLanes>([&](auto l) PIECEWORK_INLINE { xr[l] = S::load(x + r + l * x_stride); });
      unroll<K>([&](auto c) PIECEWORK_INLINE {
        const V a = S::load(block + c * kSize);
        unroll<kLanes>([&](auto l)
                           PIECEWORK_INLINE { sums.v[l][c] = S::fma(a, xr[l], sums.v[l][c]); });
      });
      block += K * kSize;
    }
    if (r == rows) return;
    const int rest = rows - r;
    V xr[kLanes];
    unroll<kLanes>([&](auto l)
                       PIECEWORK_INLINE { xr[l] = S::load_some(x + r + l * x_stride, rest); });
    unroll<K>([&](auto c) PIECEWORK_INLINE {
      const V a = S::load_some(block + c * rest, rest);
      unroll<kLanes>([&](auto l)
                         PIECEWORK_INLINE { sums.v[l][c] = S::fma(a, xr[l], sums.v[l][c]); });
    });
  }

  template <int K>
  static void backward_strip(const T* own, const T* block, const PanelView<T>& panel,
                             const Lanes<T>& x_own, const Lanes<T>& x_below, T* y, long y_stride) {
    Sums<K> sums;
    unroll<kLanes>([&](auto l) PIECEWORK_INLINE {
      unroll<K>([&](auto c) PIECEWORK_INLINE { sums.v[l][c] = S::zero(); });
    });
    if (panel.inverse) add_block<K>(own, panel.cols, x_own.data, x_own.stride, sums);
    add_block<K>(block, panel.rows, x_below.data, x_below.stride, sums);
    unroll<kLanes>([&](auto l)
                       PIECEWORK_INLINE { S::template sum<K>(sums.v[l], y + l * y_stride); });
  }

  template <int K>
  static void backward_last(int cols, const T* own, const T* block, const PanelView<T>& panel,
                            const Lanes<T>& x_own, const Lanes<T>& x_below, T* y, long y_stride) {
    if constexpr (K > 0) {
      if (cols == K)
        backward_strip<K>(own, block, panel, x_own, x_below, y, y_stride);
      else
        backward_last<K - 1>(cols, own, block, panel, x_own, x_below, y, y_stride);
    }
  }

  static void backward(const PanelView<T>& panel, int first_strip, int end_strip,
                       const Lanes<T>& x_own, const Lanes<T>& x_below, const Lanes<T>& y) {
    const long own_strip = aligned(static_cast<long>(kStrip) * panel.cols);
    const long below_strip = aligned(static_cast<long>(kStrip) * panel.rows);
    for (int s = first_strip; s < end_strip; ++s) {
      const int c = s * kStrip;
      const int cols = panel.cols - c < kStrip ? panel.cols - c : kStrip;
      const T* own = panel.own + s * own_strip;
      const T* block = panel.below + s * below_strip;
      if (cols == kStrip)
        backward_strip<kStrip>(own, block, panel, x_own, x_below, y.data + c, y.stride);
      else
        backward_last<kStrip - 1>(cols, own, block, panel, x_own, x_below, y.data + c, y.stride);
    }
  }

  static void gather(const Lanes<T>& vector, const RowRun* runs, int num_runs,
                     const Lanes<T>& out) {
    long done = 0;
    for (int k = 0; k < num_runs; ++k) {
      const int count = runs[k].length;
      for (int l = 0; l < kLanes; ++l) {
        const T* from = vector.data + runs[k].start + l * vector.stride;
        T* to = out.data + done + l * out.stride;
        int i = 0;
        for (; i + kSize <= count; i += kSize) S::store(to + i, S::load(from + i));
        if (i < count) S::store_some(to + i, S::load_some(from + i, count - i), count - i);
      }
      done += count;
    }
  }

  static void scatter_add(const Lanes<T>& vector, const RowRun* runs, int num_runs,
                          const Lanes<T>& in) {
    long done = 0;
    for (int k = 0; k < num_runs; ++k) {
      const int count = runs[k].length;
      for (int l = 0; l < kLanes; ++l) {
        T* to = vector.data + runs[k].start + l * vector.stride;
        const T* from = in.data + done + l * in.stride;
        int i = 0;
        for (; i + kSize <= count; i += kSize)
          S::store(to + i, S::add(S::load(to + i), S::load(from + i)));
        if (i < count) {
          const int rest = count - i;
          S::store_some(to + i, S::add(S::load_some(to + i, rest), S::load_some(from + i, rest)),
                        rest);
        }
      }
      done += count;
    }
  }

  static constexpr SweepKernels<T> table() { return {forward, backward, gather, scatter_add}; }
};

template <class S>
struct Dense {
  using T = typename S::Number;
  using V = typename S::V;
  static constexpr int kSize = S::kSize;
  static constexpr int kBlock = 8;  ///< columns eliminated at a time

  /// Unblocked Cholesky of a K x K block; reciprocal pivots to `inverse`.
  static bool factor_block(T* a, int ld, int cols, T* inverse) {
    for (int c = 0; c < cols; ++c) {
      T pivot = a[c + c * ld];
      for (int k = 0; k < c; ++k) pivot -= a[c + k * ld] * a[c + k * ld];
      if (!(pivot > T(0)) || !(pivot < S::kHuge)) return false;
      const T root = S::root(pivot);
      a[c + c * ld] = root;
      inverse[c] = T(1) / root;
      for (int r = c + 1; r < cols; ++r) {
        T value = a[r + c * ld];
        for (int k = 0; k < c; ++k) value -= a[r + k * ld] * a[c + k * ld];
        a[r + c * ld] = value * inverse[c];
      }
    }
    return true;
  }

  /// Rows r ... r + count - 1 of the columns below a factored block: X = X L^-T.
  template <int K>
  static void solve_block(T* a, int ld, const T* inverse, int block_row, int r, int count) {
    V x[K];
    unroll<K>([&](auto c) PIECEWORK_INLINE {
      x[c] = S::load_some(a + r + static_cast<long>(c) * ld, count);
    });
    unroll<K>([&](auto c) PIECEWORK_INLINE {
      unroll<c>([&](auto k) PIECEWORK_INLINE {
        x[c] = S::fma(S::repeat(-a[block_row + c + static_cast<long>(k) * ld]), x[k], x[c]);
      });
      x[c] = S::mul(x[c], S::repeat(inverse[c]));
    });
    unroll<K>([&](auto c) PIECEWORK_INLINE {
      S::store_some(a + r + static_cast<long>(c) * ld, x[c], count);
    });
  }

  /// Columns first ... end - 1 less L L^T, from the chunk of each column's diagonal down. `l`: K
  /// columns of L.
  template <int K>
  static void update(T* a, const T* l, int ld, int rows, int first, int end) {
    for (int r = first / kSize * kSize; r < rows; r += kSize) {
      V x[K];
      unroll<K>([&](auto k) PIECEWORK_INLINE {
        x[k] = S::negative(S::load(l + r + static_cast<long>(k) * ld));
      });
      const int last = r + kSize < end ? r + kSize : end;
      T* column = a + r + static_cast<long>(first) * ld;
      for (int c = first; c < last; ++c) {
        V sum = S::load(column);
        unroll<K>([&](auto k) PIECEWORK_INLINE {
          sum = S::fma(x[k], S::repeat(l[c + static_cast<long>(k) * ld]), sum);
        });
        S::store(column, sum);
        column += ld;
      }
    }
  }

  template <int K>
  static bool eliminate_block(T* a, int rows, int ld, int c, int end) {
    T inverse[K];
    T* l = a + static_cast<long>(c) * ld;
    if (!factor_block(l + c, ld, K, inverse)) return false;
    const int below = c + K;
    int r = below;
    while (r < rows) {  // up to the next whole chunk, then chunk by chunk
      int stop = r / kSize * kSize + kSize;
      if (stop > rows) stop = rows;
      solve_block<K>(l, ld, inverse, c, r, stop - r);
      r = stop;
    }
    update<K>(a, l, ld, rows, below, end);
    return true;
  }

  template <int K>
  static bool eliminate_last(int count, T* a, int rows, int ld, int c, int end) {
    if constexpr (K == 0) {
      return true;
    } else {
      if (count == K) return eliminate_block<K>(a, rows, ld, c, end);
      return eliminate_last<K - 1>(count, a, rows, ld, c, end);
    }
  }

  static bool eliminate(T* a, int rows, int ld, int first, int last, int end) {
    int c = first;
    for (; c + kBlock <= last; c += kBlock)
      if (!eliminate_block<kBlock>(a, rows, ld, c, end)) return false;
    return eliminate_last<kBlock - 1>(last - c, a, rows, ld, c, end);
  }

  /// Rows of X = L^-1, which solves X L = I from its last column to its first; the rows before
  /// `first_row` are zero from column first_row + kSize on.
  static void invert_rows(const T* l, int ldl, int width, int first_row, T* x, int ldx) {
    x += first_row;
    const int end = first_row + kSize < width ? first_row + kSize : width;
    for (int c = width - 1; c >= end; --c) S::store(x + static_cast<long>(c) * ldx, S::zero());
    for (int c = end - 1; c >= 0; --c) {
      const T* column = l + static_cast<long>(c) * ldl;
      T unit[kSize] = {};
      if (c >= first_row) unit[c - first_row] = T(1);
      V sum = S::load(unit);
      V other = S::zero();
      int k = c + 1;
      for (; k + 1 < end; k += 2) {
        const T* from = x + static_cast<long>(k) * ldx;
        sum = S::fma(S::load(from), S::repeat(-column[k]), sum);
        other = S::fma(S::load(from + ldx), S::repeat(-column[k + 1]), other);
      }
      if (k < end)
        sum = S::fma(S::load(x + static_cast<long>(k) * ldx), S::repeat(-column[k]), sum);
      S::store(x + static_cast<long>(c) * ldx,
               S::mul(S::add(sum, other), S::repeat(T(1) / column[c])));
    }
  }

  static void invert(const T* l, int ldl, int width, T* x, int ldx) {
    for (int r = 0; r < width; r += kSize) invert_rows(l, ldl, width, r, x, ldx);
  }

  /// K columns of -A X, from the first of the `depth` columns of A that they take part in.
  template <int K>
  static void multiply_strip(const T* a, int lda, int rows, const T* x, int ldx, int depth,
                             T* out) {
    int r = 0;
    for (; r + kSize <= rows; r += kSize) {
      V sum[K];
      unroll<K>([&](auto c) PIECEWORK_INLINE { sum[c] = S::zero(); });
      for (int k = 0; k < depth; ++k) {
        const V column = S::load(a + r + static_cast<long>(k) * lda);
        unroll<K>([&](auto c) PIECEWORK_INLINE {
          sum[c] = S::fma(column, S::repeat(x[k + static_cast<long>(c) * ldx]), sum[c]);
        });
      }
      unroll<K>([&](auto c) PIECEWORK_INLINE { S::store(out + c * kSize, S::negative(sum[c])); });
      out += K * kSize;
    }
    const int rest = rows - r;
    if (rest == 0) return;
    V sum[K];
    unroll<K>([&](auto c) PIECEWORK_INLINE { sum[c] = S::zero(); });
    for (int k = 0; k < depth; ++k) {
      const V column = S::load_some(a + r + static_cast<long>(k) * lda, rest);
      unroll<K>([&](auto c) PIECEWORK_INLINE {
        sum[c] = S::fma(column, S::repeat(x[k + static_cast<long>(c) * ldx]), sum[c]);
      });
    }
    unroll<K>([&](auto c)
                  PIECEWORK_INLINE { S::store_some(out + c * rest, S::negative(sum[c]), rest); });
  }

  template <int K>
  static void multiply_last(int cols, const T* a, int lda, int rows, const T* x, int ldx, T* out) {
    if constexpr (K > 0) {
      if (cols == K)
        multiply_strip<K>(a, lda, rows, x, ldx, K, out);
      else
        multiply_last<K - 1>(cols, a, lda, rows, x, ldx, out);
    }
  }

  static void multiply(const T* a, int lda, int rows, const T* x, int ldx, int width, T* out) {
    constexpr int kStrip = S::kStrip;
    const long strip = Sweep<S, 1>::aligned(static_cast<long>(kStrip) * rows);
    int c = 0;
    for (; c + kStrip <= width; c += kStrip, out += strip)
      multiply_strip<kStrip>(a + static_cast<long>(c) * lda, lda, rows,
                             x + c + static_cast<long>(c) * ldx, ldx, width - c, out);
    multiply_last<kStrip - 1>(width - c, a + static_cast<long>(c) * lda, lda, rows,
                              x + c + static_cast<long>(c) * ldx, ldx, out);
  }

  /// Columns c ... c + K - 1 of Z: the rows of Y from c on, each times its numbers in them. Several
  /// columns at once, or every sum would wait for the one before.
  template <int K>
  static void square_columns(const T* y, int ldy, int width, int c, T* z, int ldz, const T* work) {
    for (int r = 0; r < width; r += kSize) {
      V sum[K];
      unroll<K>([&](auto i) PIECEWORK_INLINE { sum[i] = S::zero(); });
      for (int k = c; k < width; ++k) {
        const V row = S::load(work + r + static_cast<long>(k) * ldy);
        unroll<K>([&](auto i) PIECEWORK_INLINE {
          sum[i] = S::fma(row, S::repeat(y[k + static_cast<long>(c + i) * ldy]), sum[i]);
        });
      }
      unroll<K>([&](auto i)
                    PIECEWORK_INLINE { S::store(z + r + static_cast<long>(c + i) * ldz, sum[i]); });
    }
  }

  static void square(const T* y, int ldy, int width, T* z, int ldz, T* work) {
    for (int c = 0; c < width; ++c)
      for (int r = 0; r < width; ++r)
        work[c + static_cast<long>(r) * ldy] = y[r + static_cast<long>(c) * ldy];
    int c = 0;
    for (; c + 8 <= width; c += 8) square_columns<8>(y, ldy, width, c, z, ldz, work);
    for (; c + 4 <= width; c += 4) square_columns<4>(y, ldy, width, c, z, ldz, work);
    for (; c < width; ++c) square_columns<1>(y, ldy, width, c, z, ldz, work);
  }

  static void add(T* to, const T* from, int count) {
    int i = 0;
    for (; i + kSize <= count; i += kSize)
      S::store(to + i, S::add(S::load(to + i), S::load(from + i)));
    if (i < count)
      S::store_some(to + i,
                    S::add(S::load_some(to + i, count - i), S::load_some(from + i, count - i)),
                    count - i);
  }

  /// Run after run of rows, each across all columns: were it column after column, the next run's
  /// load would often have to wait for the store of the one before, to the same cache line.
  static void extend_add(T* a, int lda, const T* b, int ldb, const RowRun* runs, int num_runs) {
    long row = 0;  // of B: the run's first
    for (int m = 0; m < num_runs; ++m) {
      const RowRun rows = runs[m];
      const T* from = b + row;
      for (int k = 0; k < m; ++k) {
        T* to = a + rows.start + static_cast<long>(runs[k].start) * lda;
        for (int i = 0; i < runs[k].length; ++i, to += lda, from += ldb) add(to, from, rows.length);
      }
      T* to = a + rows.start + static_cast<long>(rows.start) * lda;
      for (int i = 0; i < rows.length; ++i, to += lda + 1, from += ldb + 1)
        add(to, from, rows.length - i);
      row += rows.length;
    }
  }

  static constexpr DenseKernels<T> table() {
    return {eliminate, invert, multiply, square, extend_add};
  }
};

template <class S>
constexpr Kernels<typename S::Number> kernels_of() {
  return {{S::kStrip, S::kSize, 64 / static_cast<int>(sizeof(typename S::Number))},
          Sweep<S, 1>::table(),
          Sweep<S, kMaxLanes>::table(),
          Dense<S>::table()};
}

}  // namespace
