// The loops of kernels.hpp over vectors of eight doubles, which the compiler splits into what the
// instruction set has; included by one source file per instruction set. No inline function or
// template of another header is called here: such code, compiled for AVX-512, could be chosen by
// the linker for everyone.

namespace {

typedef double V __attribute__((vector_size(64)));
typedef long Mask __attribute__((vector_size(64)));
static_assert(sizeof(V) == kLanes * sizeof(double));

/// Below this ratio of sigma_1 sigma_2 to sigma_1^2 + sigma_2^2 a triangle counts as degenerate;
/// the value of model::closest_isometry().
constexpr double kRankTolerance = 1e-7;
constexpr double kInverseSqrt2 = 0.70710678118654752440;
constexpr double kLargest = 1.79769313486231570815e308;

V load(const double* p) { return *reinterpret_cast<const V*>(p); }

/// Unaligned.
V read(const double* p) {
  V v;
  __builtin_memcpy(&v, p, sizeof v);
  return v;
}
void write(double* p, V v) { __builtin_memcpy(p, &v, sizeof v); }

V read(const float* p) {
  typedef float Half __attribute__((vector_size(32)));
  Half v;
  __builtin_memcpy(&v, p, sizeof v);
  return __builtin_convertvector(v, V);
}

V repeat(double number) { return V{} + number; }

V root(V v) {
  V result;
  for (int i = 0; i < kLanes; ++i) result[i] = __builtin_sqrt(v[i]);
  return result;
}

V smaller(V a, V b) { return a < b ? a : b; }

double total(V v) { return ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7])); }

struct V3 {
  V x, y, z;
};
V dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
V3 mix(V p, const V3& a, V q, const V3& b) {
  return {p * a.x + q * b.x, p * a.y + q * b.y, p * a.z + q * b.z};
}

V3 gather(const double* rows, const int* offset) {
  alignas(64) double x[kLanes];
  alignas(64) double y[kLanes];
  alignas(64) double z[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const double* row = rows + offset[i];
    x[i] = row[0];
    y[i] = row[1];
    z[i] = row[2];
  }
  return {load(x), load(y), load(z)};
}

/// Symmetric 2 x 2.
struct Sym2 {
  V a, b, c;
};

/// Eigenvalues above 1 become 1.
Sym2 clamped(const Sym2& B) {
  const V one = repeat(1);
  const V mean = 0.5 * (B.a + B.c);
  const V offset = 0.5 * (B.a - B.c);
  const V half_gap = root(offset * offset + B.b * B.b);
  const V high = mean + half_gap;
  const V low = mean - half_gap;
  // The projector onto the larger eigenvalue is (B - low I) / (high - low).
  const Mask cut = high > one;
  const Mask all = low >= one;
  const V scale = cut ? (high - one) / (half_gap + half_gap) : repeat(0);
  const V zero = repeat(0);
  return {all ? one : B.a - scale * (B.a - low), all ? zero : B.b - scale * B.b,
          all ? one : B.c - scale * (B.c - low)};
}

void normal_batch(const NormalBatch& batch, const double* x, const double* normals, double* pairs) {
  const V m00 = load(batch.inverse[0]);
  const V m01 = load(batch.inverse[1]);
  const V m10 = load(batch.inverse[2]);
  const V m11 = load(batch.inverse[3]);
  const V3 x0 = gather(x, batch.vertex[0]);
  const V3 x1 = gather(x, batch.vertex[1]);
  const V3 x2 = gather(x, batch.vertex[2]);
  const V3 e1{x1.x - x0.x, x1.y - x0.y, x1.z - x0.z};
  const V3 e2{x2.x - x0.x, x2.y - x0.y, x2.z - x0.z};
  const V3 a = mix(m00, e1, m10, e2);
  const V3 b = mix(m01, e1, m11, e2);
  const V aa = dot(a, a);
  const V bb = dot(b, b);
  const V ab = dot(a, b);
  const V3 area = cross(a, b);
  const V s = root(dot(area, area));
  const V trace = root(aa + bb + (s + s));
  const V inverse = 1.0 / (s * trace);
  const Mask usable = (s > kRankTolerance * (aa + bb)) & (inverse <= repeat(kLargest));

  const V3 R1 = mix((bb + s) * inverse, a, -ab * inverse, b);
  const V3 R2 = mix((aa + s) * inverse, b, -ab * inverse, a);
  const V inverse_s = 1.0 / s;
  const V3 n{area.x * inverse_s, area.y * inverse_s, area.z * inverse_s};
  const V weight = load(batch.weight);
  const V c_T = smaller(repeat(1), 2.0 / trace);
  const Sym2 B = clamped({(bb + s) * inverse, -ab * inverse, (aa + s) * inverse});

  const V g1[3] = {-(m00 + m10), m00, m10};
  const V g2[3] = {-(m01 + m11), m01, m11};
  V turn[3];
  V out[3];
  for (int k = 0; k < 3; ++k) {
    const V3 normal = gather(normals, batch.unknown[k]);
    turn[k] = kInverseSqrt2 * (g2[k] * dot(normal, R1) - g1[k] * dot(normal, R2));
    out[k] = dot(normal, n);
  }
  int pair = 0;
  for (int i = 0; i < 3; ++i) {
    const V turn_i = weight * c_T * turn[i];
    const V p = weight * out[i] * (B.a * g1[i] + B.b * g2[i]);
    const V q = weight * out[i] * (B.b * g1[i] + B.c * g2[i]);
    for (int j = 0; j <= i; ++j) {
      const V value = turn_i * turn[j] + (p * g1[j] + q * g2[j]) * out[j];
      write(pairs + kLanes * pair++, usable ? value : repeat(0));
    }
  }
}

void normal_pairs(const NormalBatch* batches, int count, const double* x, const double* normals,
                  double* pairs) {
  for (int i = 0; i < count; ++i)
    normal_batch(batches[i], x, normals, pairs + static_cast<long>(i) * kPairs * kLanes);
}

template <class A, class B>
double product(const A* a, const B* b, std::size_t begin, std::size_t end) {
  V sum = repeat(0);
  V more = repeat(0);
  std::size_t i = begin;
  for (; i + 2 * kLanes <= end; i += 2 * kLanes) {
    sum += read(a + i) * read(b + i);
    more += read(a + i + kLanes) * read(b + i + kLanes);
  }
  double rest = 0;
  for (; i < end; ++i) rest += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return total(sum + more) + rest;
}

void products(const FloatRows& rows, const double* with, std::size_t begin, std::size_t end,
              double* sum) {
  for (int k = 0; k < rows.count; ++k) sum[k] = product(rows.row[k], with, begin, end);
}

void combine(double factor, const double* base, const FloatRows& rows, const double* weight,
             std::size_t begin, std::size_t end, double* out) {
  std::size_t i = begin;
  for (; i + kLanes <= end; i += kLanes) {
    V sum = factor * read(base + i);
    for (int k = 0; k < rows.count; ++k) sum += weight[k] * read(rows.row[k] + i);
    write(out + i, sum);
  }
  for (; i < end; ++i) {
    double sum = factor * base[i];
    for (int k = 0; k < rows.count; ++k) sum += weight[k] * static_cast<double>(rows.row[k][i]);
    out[i] = sum;
  }
}

void difference(double step, const double* d, const double* before, const double* after,
                std::size_t begin, std::size_t end, float* s, float* y) {
  for (std::size_t i = begin; i < end; ++i) {
    s[i] = static_cast<float>(step * d[i]);
    y[i] = static_cast<float>(after[i] - before[i]);
  }
}

void two_products(const FloatRows& rows, const float* y, const double* after, std::size_t begin,
                  std::size_t end, double* with_y, double* with_after) {
  for (int k = 0; k < rows.count; ++k) {
    with_y[k] = product(rows.row[k], y, begin, end);
    with_after[k] = product(rows.row[k], after, begin, end);
  }
}

double dot_product(const double* a, const double* b, std::size_t begin, std::size_t end) {
  return product(a, b, begin, end);
}

/// Three numbers and one that nobody uses.
typedef double Row __attribute__((vector_size(32)));

Row widen(const float* p) {
  Row row;
  for (int i = 0; i < 4; ++i) row[i] = p[i];
  return row;
}

void block_product(const BlockRows& rows, const double* x, std::size_t begin, std::size_t end,
                   double* y) {
  for (std::size_t i = begin; i < end; ++i) {
    Row sum[3] = {};
    for (int k = rows.dense.begin[i]; k < rows.dense.begin[i + 1]; ++k) {
      const double* v = x + rows.dense.offset[k];
      const float* block = rows.dense.numbers + 9 * static_cast<long>(k);
      for (int j = 0; j < 3; ++j) sum[j] += v[j] * widen(block + 3 * j);
    }
    for (int k = rows.scalar.begin[i]; k < rows.scalar.begin[i + 1]; ++k) {
      const double* v = x + rows.scalar.offset[k];
      sum[0] += static_cast<double>(rows.scalar.numbers[k]) * Row{v[0], v[1], v[2], 0};
    }
    const Row total = sum[0] + sum[1] + sum[2];
    for (std::size_t j = 0; j < 3; ++j) y[3 * i + j] = total[j];
  }
}

constexpr OuterKernels kTable{normal_pairs, products,      combine,    difference,
                              two_products, block_product, dot_product};

}  // namespace
