// Kernels in plain C++: what every machine can run, and what the others are tested against.

#include "patch_kernels.hpp"

namespace piecework::local {
namespace {

/// Four numbers as a vector; the compiler finds the instructions that the target has.
struct Four {
  double v[4];
};

template <class Function>
__attribute__((always_inline)) inline Four each(const Function& function) {
  Four r;
  for (int i = 0; i < 4; ++i) r.v[i] = function(i);
  return r;
}

struct PlainLanes {
  using V = Four;
  using Row = Four;
  struct Mask {
    bool set[4];
  };
  static constexpr int kSize = 4;

  static V load(const double* p) {
    return each([&](int i) { return p[i]; });
  }
  static V repeat(double number) { return {{number, number, number, number}}; }
  static V zero() { return {}; }
  static V add(const V& a, const V& b) {
    return each([&](int i) { return a.v[i] + b.v[i]; });
  }
  static V sub(const V& a, const V& b) {
    return each([&](int i) { return a.v[i] - b.v[i]; });
  }
  static V mul(const V& a, const V& b) {
    return each([&](int i) { return a.v[i] * b.v[i]; });
  }
  static V div(const V& a, const V& b) {
    return each([&](int i) { return a.v[i] / b.v[i]; });
  }
  static V root(const V& a) {
    return each([&](int i) { return __builtin_sqrt(a.v[i]); });
  }
  static V fma(const V& a, const V& b, const V& c) {
    return each([&](int i) { return a.v[i] * b.v[i] + c.v[i]; });
  }
  static V fms(const V& a, const V& b, const V& c) {
    return each([&](int i) { return a.v[i] * b.v[i] - c.v[i]; });
  }
  static V fnma(const V& a, const V& b, const V& c) {
    return each([&](int i) { return c.v[i] - a.v[i] * b.v[i]; });
  }
  static double total(const V& v) { return (v.v[0] + v.v[2]) + (v.v[1] + v.v[3]); }

  static Mask usable(const V& s, const V& limit, const V& scale) {
    Mask mask;
    for (int i = 0; i < 4; ++i) mask.set[i] = s.v[i] > limit.v[i] && scale.v[i] <= __DBL_MAX__;
    return mask;
  }
  static V keep(const Mask& mask, const V& v) {
    return each([&](int i) { return mask.set[i] ? v.v[i] : 0.0; });
  }
  static unsigned bits(const Mask& mask) {
    unsigned result = 0;
    for (int i = 0; i < 4; ++i) result |= static_cast<unsigned>(mask.set[i]) << i;
    return result;
  }

  static void edges(const double* x, const BatchCorners& corners, int first, V* e) {
    for (int i = 0; i < 4; ++i) {
      const double* x0 = x + corners.corner[0][first + i];
      const double* x1 = x + corners.corner[1][first + i];
      const double* x2 = x + corners.corner[2][first + i];
      for (int k = 0; k < 3; ++k) {
        e[k].v[i] = x1[k] - x0[k];
        e[3 + k].v[i] = x2[k] - x0[k];
      }
    }
  }

  static void add_forces(const V* f, const BatchCorners& corners, int first, double* force) {
    for (int i = 0; i < 4; ++i) {
      double* f0 = force + corners.corner[0][first + i];
      double* f1 = force + corners.corner[1][first + i];
      double* f2 = force + corners.corner[2][first + i];
      for (int k = 0; k < 3; ++k) {
        f0[k] -= f[k].v[i] + f[3 + k].v[i];
        f1[k] += f[k].v[i];
        f2[k] += f[3 + k].v[i];
      }
    }
  }

  static Row load_row(const double* p) { return load(p); }
  static void store_row(double* p, const Row& r) {
    for (int i = 0; i < 4; ++i) p[i] = r.v[i];
  }
  static Row load3(const double* p) { return {{p[0], p[1], p[2], 0.0}}; }
  static void store3(double* p, const Row& r) {
    for (int i = 0; i < 3; ++i) p[i] = r.v[i];
  }
  static Row repeat_row(const double* p) { return repeat(*p); }
  static Row row_add(const Row& a, const Row& b) { return add(a, b); }
  static Row row_sub(const Row& a, const Row& b) { return sub(a, b); }
  static Row row_mul(const Row& a, const Row& b) { return mul(a, b); }
  static Row row_fma(const Row& a, const Row& b, const Row& c) { return fma(a, b, c); }
  static Row row_fnma(const Row& a, const Row& b, const Row& c) { return fnma(a, b, c); }
  static Row row_zero() { return {}; }
  static double row_total(const Row& r) { return total(r); }
  static double norm_sq(const Row& r) { return total(mul(r, r)); }
  static double root_of(double number) { return __builtin_sqrt(number); }
};

}  // namespace

#include "patch_kernels_impl.hpp"

const PatchKernels& portable_patch_kernels() {
  static constexpr PatchKernels kTable = PatchLoops<PlainLanes>::table();
  return kTable;
}

}  // namespace piecework::local
