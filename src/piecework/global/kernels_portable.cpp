// Kernels in plain C++: what every machine can run, and what the others are tested against.

#include "kernels.hpp"

namespace piecework::global {
namespace {

/// Four numbers as a vector; the compiler finds the instructions that the target has.
template <class Float>
struct Plain4 {
  using Number = Float;
  struct V {
    Float v[4];
  };
  static constexpr int kSize = 4;
  static constexpr int kStrip = 4;

  static V load(const Float* p) { return {{p[0], p[1], p[2], p[3]}}; }
  static void store(Float* p, const V& a) {
    for (int i = 0; i < 4; ++i) p[i] = a.v[i];
  }
  static V load_some(const Float* p, int n) {
    V result{};
    for (int i = 0; i < n; ++i) result.v[i] = p[i];
    return result;
  }
  static void store_some(Float* p, const V& a, int n) {
    for (int i = 0; i < n; ++i) p[i] = a.v[i];
  }
  static V repeat(Float number) { return {{number, number, number, number}}; }
  static V fma(const V& a, const V& b, V c) {
    for (int i = 0; i < 4; ++i) c.v[i] += a.v[i] * b.v[i];
    return c;
  }
  static V add(const V& a, V b) {
    for (int i = 0; i < 4; ++i) b.v[i] += a.v[i];
    return b;
  }
  static V zero() { return {}; }
  static V mul(const V& a, V b) {
    for (int i = 0; i < 4; ++i) b.v[i] *= a.v[i];
    return b;
  }
  static V negative(V a) {
    for (int i = 0; i < 4; ++i) a.v[i] = -a.v[i];
    return a;
  }
  static Float root(Float number) {
    if constexpr (sizeof(Float) == 4) return __builtin_sqrtf(number);
    return static_cast<Float>(__builtin_sqrt(static_cast<double>(number)));
  }
  static constexpr Float kHuge = sizeof(Float) == 4 ? Float(__FLT_MAX__) : Float(__DBL_MAX__);

  template <int K>
  __attribute__((always_inline)) static inline void sum(const V (&v)[K], Float* out) {
    for (int k = 0; k < K; ++k) out[k] = (v[k].v[0] + v[k].v[1]) + (v[k].v[2] + v[k].v[3]);
  }
};

}  // namespace

#include "kernels_impl.hpp"

template <>
const Kernels<float>& portable_kernels<float>() {
  static constexpr Kernels<float> table = kernels_of<Plain4<float>>();
  return table;
}

template <>
const Kernels<double>& portable_kernels<double>() {
  static constexpr Kernels<double> table = kernels_of<Plain4<double>>();
  return table;
}

}  // namespace piecework::global
