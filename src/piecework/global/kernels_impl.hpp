// The sweeps, written once over a type of vectors; included by one source file per instruction set.
// No inline function or template of another header is called here: such code, compiled for AVX-512,
// could be chosen by the linker for everyone.
//
// A type of vectors S has: Number, V, kSize (numbers per vector), kStrip (columns per strip), load,
// store, load_some(p, n), store_some(p, v, n) for n < kSize, repeat(number), fma, add, zero and
// sum<K>(v, out): out[k] = the sum of the numbers of v[k].

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
constexpr Kernels<typename S::Number> kernels_of() {
  return {{S::kStrip, S::kSize, 64 / static_cast<int>(sizeof(typename S::Number))},
          Sweep<S, 1>::table(),
          Sweep<S, kMaxLanes>::table()};
}

}  // namespace
