// The loops over a patch, written once over types of vectors; included by one source file per
// instruction set. No inline function or template of another header is called here: such code,
// compiled for AVX-512, could be chosen by the linker for everyone.
//
// A type of vectors S has
//   V, kSize       as many triangles side by side: load, repeat, add, sub, mul, div, root,
//                  fma(a, b, c) = a b + c, fms(a, b, c) = a b - c, fnma(a, b, c) = c - a b,
//                  zero, total(v): the sum of its numbers
//   Mask           usable(s, limit, scale): s > limit and scale finite; false for NaN;
//                  keep(mask, v): 0 where not set; bits(mask)
//   edges(x, corners, first, e), add_forces(f, corners, first, force): between rows and lanes
//   Row            of four numbers: load_row, store_row, load3 and store3 (three numbers in
//                  memory), repeat_row(p), row_add, row_sub, row_mul, row_fma, row_fnma, row_zero,
//                  norm_sq(row), row_total

namespace {

/// Below this ratio of sigma_1 sigma_2 to sigma_1^2 + sigma_2^2 a triangle counts as degenerate;
/// the value of model::closest_isometry().
constexpr double kRankTolerance = 1e-7;

/// Batches by which memory is asked for what comes, next patch included: its numbers follow.
constexpr int kAhead = 8;

/// No prefetcher follows three streams that take turns. Addresses past the end do no harm.
template <unsigned kBytes>
__attribute__((always_inline)) inline void fetch(const void* p) {
  for (unsigned i = 0; i < kBytes; i += 64) __builtin_prefetch(static_cast<const char*>(p) + i);
}

template <class S>
struct PatchLoops {
  using V = typename S::V;
  using Row = typename S::Row;

  static V dot(const V* a, const V* b) {
    return S::fma(a[2], b[2], S::fma(a[1], b[1], S::mul(a[0], b[0])));
  }

  /// sigma_1 sigma_2 = |a x b|: the determinant of F^T F would cancel.
  static V area(const V* a, const V* b) {
    V c[3];
    c[0] = S::fms(a[1], b[2], S::mul(a[2], b[1]));
    c[1] = S::fms(a[2], b[0], S::mul(a[0], b[2]));
    c[2] = S::fms(a[0], b[1], S::mul(a[1], b[0]));
    return S::root(dot(c, c));
  }

  /// With F = [a b], C = F^T F and s = sqrt(det C): C^-1/2 = scale (adj C + s I), and
  ///     F - R = F (I - C^-1/2),   scale = 1 / (s sqrt(tr C + 2 s)).
  static void triangle_lanes(const TriangleBatch& batch, const BatchCorners& corners, int first,
                             const double* x, double* force, V& energy, unsigned& degenerate) {
    const V g00 = S::load(batch.g00 + first);
    const V g01 = S::load(batch.g01 + first);
    const V g11 = S::load(batch.g11 + first);
    V e[6];
    S::edges(x, corners, first, e);
    V a[3];
    V b[3];
    for (int k = 0; k < 3; ++k) {
      a[k] = S::mul(g00, e[k]);
      b[k] = S::fma(g11, e[3 + k], S::mul(g01, e[k]));
    }
    const V aa = dot(a, a);
    const V bb = dot(b, b);
    const V ab = dot(a, b);
    const V s = area(a, b);
    const V trace = S::add(aa, bb);
    const V one = S::repeat(1.0);
    V scale = S::div(one, S::mul(s, S::root(S::fma(S::repeat(2.0), s, trace))));
    const auto usable = S::usable(s, S::mul(S::repeat(kRankTolerance), trace), scale);
    degenerate = ~S::bits(usable) & ((1U << S::kSize) - 1U);
    scale = S::keep(usable, scale);
    const V weight = S::keep(usable, S::load(batch.weight + first));
    const V m00 = S::fnma(scale, S::add(bb, s), one);
    const V m01 = S::mul(scale, ab);
    const V m11 = S::fnma(scale, S::add(aa, s), one);
    V sum = S::zero();
    V f[6];
    for (int k = 0; k < 3; ++k) {
      const V p = S::fma(m00, a[k], S::mul(m01, b[k]));
      const V q = S::fma(m01, a[k], S::mul(m11, b[k]));
      sum = S::fma(p, p, S::fma(q, q, sum));
      const V wq = S::mul(weight, q);
      f[k] = S::fma(g00, S::mul(weight, p), S::mul(g01, wq));
      f[3 + k] = S::mul(g11, wq);
    }
    energy = S::fma(weight, sum, energy);
    S::add_forces(f, corners, first, force);
  }

  static double triangles(const TriangleBatch* batches, const BatchCorners* corners, int count,
                          const double* x, double* force, Degenerate& degenerate) {
    V energy = S::zero();
    for (int i = 0; i < count; ++i) {
      fetch<sizeof(TriangleBatch)>(batches + i + kAhead);
      fetch<sizeof(BatchCorners)>(corners + i + kAhead);
      for (int first = 0; first < kLanes; first += S::kSize) {
        unsigned bad = 0;
        triangle_lanes(batches[i], corners[i], first, x, force, energy, bad);
        for (; __builtin_expect(bad != 0, 0); bad &= bad - 1)
          degenerate.slot[degenerate.count++] = i * kLanes + first + __builtin_ctz(bad);
      }
    }
    return 0.5 * S::total(energy);
  }

  struct HingeRows {
    Row c1, c2, c3;
    Row value;  ///< c^T x
  };

  /// The coefficients sum to zero, so differences to one vertex keep the accuracy.
  static HingeRows read(const FlatHinge& h, const double* x) {
    const Row x0 = S::load_row(x + h.vertex[0]);
    HingeRows r{S::repeat_row(h.coefficient), S::repeat_row(h.coefficient + 1),
                S::repeat_row(h.coefficient + 2), S::row_zero()};
    r.value = S::row_mul(r.c1, S::row_sub(S::load_row(x + h.vertex[1]), x0));
    r.value = S::row_fma(r.c2, S::row_sub(S::load_row(x + h.vertex[2]), x0), r.value);
    r.value = S::row_fma(r.c3, S::row_sub(S::load_row(x + h.vertex[3]), x0), r.value);
    return r;
  }

  static void write(const FlatHinge& h, const HingeRows& r, double* force) {
    double* f0 = force + h.vertex[0];
    double* f1 = force + h.vertex[1];
    double* f2 = force + h.vertex[2];
    double* f3 = force + h.vertex[3];
    const Row sum = S::row_add(S::row_add(r.c1, r.c2), r.c3);
    S::store_row(f0, S::row_fnma(sum, r.value, S::load_row(f0)));
    S::store_row(f1, S::row_fma(r.c1, r.value, S::load_row(f1)));
    S::store_row(f2, S::row_fma(r.c2, r.value, S::load_row(f2)));
    S::store_row(f3, S::row_fma(r.c3, r.value, S::load_row(f3)));
  }

  static double flat(const FlatHinge* hinges, int count, const double* x, double* force) {
    Row energy = S::row_zero();
    for (int i = 0; i < count; ++i) {
      fetch<sizeof(FlatHinge)>(hinges + i + kLanes * kAhead);
      const HingeRows r = read(hinges[i], x);
      energy = S::row_fma(r.value, r.value, energy);
      write(hinges[i], r, force);
    }
    return 0.5 * S::row_total(energy);
  }

  static double curved(const CurvedHinge* hinges, int count, const double* x, double* force) {
    Row energy = S::row_zero();
    double waiting = 0;
    for (int i = 0; i < count; ++i) {
      HingeRows r = read(hinges[i].hinge, x);
      const double rest = hinges[i].rest_length;
      const double length = S::root_of(S::norm_sq(r.value));
      // A curved hinge that is momentarily flat has no direction to aim at: it waits, and its
      // energy is the one that it has nearby.
      const bool aims = length > 1e-12 * rest;
      const double factor = aims ? 1.0 - rest / length : 1.0;
      if (!aims) waiting += rest * rest;
      r.value = S::row_mul(S::repeat_row(&factor), r.value);
      energy = S::row_fma(r.value, r.value, energy);
      write(hinges[i].hinge, r, force);
    }
    return 0.5 * (S::row_total(energy) + waiting);
  }

  static void gather(const double* x, const int* vertex, int count, double* rows) {
    for (int i = 0; i < count; ++i) S::store_row(rows + 4L * i, S::load3(x + 3L * vertex[i]));
  }

  static double finish(const InnerVertices& vertices, const double* x, const double* force,
                       double* gradient) {
    Row energy = S::row_zero();
    for (int i = 0; i < vertices.count; ++i) {
      const long v = vertices.vertex[i];
      const long later = vertices.vertex[i + kAhead < vertices.count ? i + kAhead : i];
      __builtin_prefetch(vertices.predicted + 3 * later);
      __builtin_prefetch(gradient + 3 * later, 1);
      if (vertices.fixed[v]) {
        S::store3(gradient + 3 * v, S::row_zero());
        continue;
      }
      const Row inertia = S::repeat_row(vertices.inertia + i);
      const Row offset = S::row_sub(S::load_row(x + 4L * i), S::load3(vertices.predicted + 3 * v));
      const Row pull = S::row_mul(inertia, offset);
      energy = S::row_fma(pull, offset, energy);
      S::store3(gradient + 3 * v, S::row_add(pull, S::load_row(force + 4L * i)));
    }
    return 0.5 * S::row_total(energy);
  }

  static constexpr PatchKernels table() { return {gather, triangles, flat, curved, finish}; }
};

}  // namespace
