#include <piecework/collision/ccd.hpp>

#include <algorithm>
#include <cmath>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

// Two facts carry the method.
//
// 1. Elements that touch are coplanar: the cubic f(t) = det(p, q, r) of three differences between
//    their vertices is zero. Where |f| exceeds its rounding error there is no contact.
// 2. Along any fixed axis n, the separation of the two convex elements is the smallest of the
//    numbers n . (difference of two vertices), each linear in t, and is no larger than |n| times
//    the distance. So an axis found in whatever way proves a whole interval free of contact.
//
// The cubic says where contact is possible at all, closest points supply good axes, and neither has
// to be accurate for the answer to be safe.

namespace piecework::collision {
namespace {

constexpr double kUnit = 0x1p-53;  // relative error of one rounding
// Between these, squares of volumes neither underflow nor overflow.
constexpr double kSmallest = 1e-45, kLargest = 1e45;
constexpr int kMaxRootSteps = 24;  // of Halley or Newton before bisection takes over
constexpr int kMaxSteps = 256;     // of conservative advancement before it stops, which is a hit
constexpr double kSlow = 0.5;      // steps that shrink by less than this call for longer ones

/// Differences between each vertex of the first element and each of the second, at both ends of
/// the motion. Taken between given numbers, each has one rounding error, relative to itself; hence
/// a common translation, however far, costs no accuracy.
struct Motion {
  PairKind kind;
  std::array<Vec3, 4> start, end;
  double size;      ///< largest |coordinate| in them
  bool computable;  ///< all are finite and neither too small nor too large
};

std::array<Vec3, 4> differences(PairKind kind, const PairPoints& x) {
  // The last one of VT is there twice: four of either kind need no branches.
  if (kind == PairKind::VertexTriangle) return {x[0] - x[1], x[0] - x[2], x[0] - x[3], x[0] - x[3]};
  return {x[0] - x[2], x[0] - x[3], x[1] - x[2], x[1] - x[3]};
}

Motion relative_motion(PairKind kind, const PairPoints& start, const PairPoints& end) {
  Motion m{kind, differences(kind, start), differences(kind, end), 0, false};
  Vec3 largest = Vec3::Zero(), total = Vec3::Zero();
  for (std::size_t k = 0; k < 4; ++k) {
    const Vec3 a = m.start[k].cwiseAbs(), b = m.end[k].cwiseAbs();
    largest = largest.cwiseMax(a.cwiseMax(b));
    total += a + b;
  }
  m.size = largest.maxCoeff();
  m.computable = m.size > kSmallest && total.sum() < kLargest;  // false for NaN
  return m;
}

Vec3 difference_at(const Motion& m, std::size_t k, double t) {
  return (1 - t) * m.start[k] + t * m.end[k];
}

/// The pair at time t with its first vertex at the origin.
PairPoints points_at(const Motion& m, double t) {
  const auto d = [&](std::size_t k) { return difference_at(m, k, t); };
  if (m.kind == PairKind::VertexTriangle) return {Vec3::Zero(), -d(0), -d(1), -d(2)};
  return {Vec3::Zero(), d(2) - d(0), -d(0), -d(1)};
}

/// The latest time up to which the axis proves, from t on, that the distance exceeds `separation`:
/// t if it proves nothing, 1 if it proves all.
double separated_until(const Motion& m, const Vec3& axis, double t, double separation) {
  // A bound on |axis . difference|: the products and sums below err by less than 8 units of it.
  const double reach = m.size * (std::abs(axis[0]) + std::abs(axis[1]) + std::abs(axis[2]));
  if (!(reach > 1e-280)) return t;
  double limit = 16 * kUnit * reach;
  if (separation > 0) limit += (1 + 8 * kUnit) * separation * axis.norm();
  double until = 1;
  for (std::size_t k = 0; k < 4; ++k) {
    const double a = axis.dot(m.start[k]), b = axis.dot(m.end[k]);
    if (!((1 - t) * a + t * b > limit)) return t;
    if (b <= limit) until = std::min(until, (1 - 8 * kUnit) * ((a - limit) / (a - b)));
  }
  return std::max(until, t);
}

/// Whether an axis that turns from one unit vector to another between two times proves that the
/// distance exceeds `separation` all the while. With an axis a + s (b - a), no longer than 1, the
/// separations are quadratic in s, and above their lowest Bernstein coefficient.
bool separated_between(const Motion& m, const Vec3& first, double t0, const Vec3& second, double t1,
                       double separation) {
  const double limit = (1 + 8 * kUnit) * separation + 32 * kUnit * m.size;
  for (std::size_t k = 0; k < 4; ++k) {
    const Vec3 d0 = difference_at(m, k, t0), d1 = difference_at(m, k, t1);
    const double middle = 0.5 * (first.dot(d1) + second.dot(d0));
    // Each compared by itself: NaN must not get lost in a minimum.
    if (!(first.dot(d0) > limit && middle > limit && second.dot(d1) > limit)) return false;
  }
  return true;
}

/// A multiple of the offset from the mean of the second element's vertices to that of the first's,
/// at both ends together (VT: nearly): where elements are apart, a cheap and often a good axis.
Vec3 axis_between_centres(const Motion& m) {
  Vec3 sum = m.start[0] + m.end[0];
  for (std::size_t k = 1; k < 4; ++k) sum += m.start[k] + m.end[k];
  return sum;
}

/// c[0] + c[1] t + c[2] t^2 + c[3] t^3.
struct Cubic {
  std::array<double, 4> c;
  double operator()(double t) const { return ((c[3] * t + c[2]) * t + c[1]) * t + c[0]; }
  [[nodiscard]] double slope(double t) const { return (3 * c[3] * t + 2 * c[2]) * t + c[1]; }
  [[nodiscard]] double curvature(double t) const { return 6 * c[3] * t + 2 * c[2]; }
};

struct Coplanarity {
  Cubic f;
  double error;  ///< |f| above this is not zero in exact arithmetic
  bool never;    ///< f has no zero in [0, 1]
};

Coplanarity coplanarity(const Motion& m) {
  const auto& [p0, q0, r0, s0] = m.start;
  const auto& [p1, q1, r1, s1] = m.end;
  const Vec3 n00 = q0.cross(r0), n11 = q1.cross(r1), n01 = q0.cross(r1) + q1.cross(r0);
  // Bernstein coefficients, the inner two times 3.
  const double b0 = p0.dot(n00), b1 = p1.dot(n00) + p0.dot(n01);
  const double b2 = p1.dot(n01) + p0.dot(n11), b3 = p1.dot(n11);
  // A coefficient is a mean of determinants, 6 products of three factors each, every product with
  // at most 12 roundings: less than 80 units of size^3.
  const double error = 80 * kUnit * m.size * m.size * m.size;
  const double low = std::min(std::min(b0, b3), std::min(b1, b2) / 3);
  const double high = std::max(std::max(b0, b3), std::max(b1, b2) / 3);
  if (low > error || high < -error) return {{}, error, true};
  // Conversion to powers and Horner's rule: less than 256 units of the largest coefficient. The
  // other half of 512 covers what rounding of the critical points leaves of monotonicity.
  return {{{b0, b1 - 3 * b0, b2 - 2 * b1 + 3 * b0, b3 - b2 + b1 - b0}},
          error + 512 * kUnit * std::max(high, -low),
          false};
}

/// Step of the root finder from t, where f has the given value; not finite where it has none.
double root_step(const Cubic& f, double t, double value, CcdMethod method) {
  const double slope = f.slope(t);
  if (method == CcdMethod::Newton) return -value / slope;
  return -2 * value * slope / (2 * slope * slope - value * f.curvature(t));
}

/// f is monotone in [low, high] with f(low) > 0 >= f(high). The left end, f > 0, of a bracket no
/// wider than the tolerance.
double last_above_zero(const Cubic& f, double low, double high, const CcdOptions& options,
                       double tolerance, int& evaluations) {
  const double at_low = f(low), at_high = f(high);
  double t = low + (high - low) * (at_low / (at_low - at_high));
  for (int step = 0;; ++step) {
    if (!(low < t && t < high) || step > kMaxRootSteps) t = 0.5 * (low + high);
    const double value = f(t);
    ++evaluations;
    (value > 0 ? low : high) = t;
    if (high - low <= tolerance) return low;
    const double move = root_step(f, t, value, options.method);
    // Once it has converged, a step to beyond the root closes the bracket from the other side.
    if (std::abs(move) < 0.5 * tolerance)
      t += value > 0 ? 0.9 * tolerance : -0.9 * tolerance;
    else
      t += move;
  }
}

/// Ends of the pieces of [0, 1] in which f is monotone.
struct Pieces {
  std::array<double, 4> ends;
  std::size_t count;  ///< of pieces, 1 to 3
};

Pieces monotone_pieces(const Cubic& f) {
  Pieces p{{0, 1, 1, 1}, 1};
  const double a = 3 * f.c[3], b = f.c[2], c = f.c[1];  // f' = a t^2 + 2 b t + c
  const double discriminant = b * b - a * c;
  if (!(discriminant > 0)) return p;
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  const double first = std::min(q / a, c / q), second = std::max(q / a, c / q);
  for (const double t : {first, second})
    if (t > 0 && t < 1) p.ends[p.count++] = t;
  p.ends[p.count] = 1;
  return p;
}

class Search {
 public:
  Search(const Motion& motion, const CcdOptions& options, double separation)
      : motion_(motion),
        options_(options),
        separation_(separation),
        tolerance_(std::max(1e-14, options.tolerance)) {}

  /// Advances from `from` to `to`, axis by axis; stops early where `left(t)`, which says that
  /// contact has become impossible again. True when it cannot go on: a hit.
  ///
  /// A fixed axis is worth little where the elements turn or graze. Where its steps hardly shrink,
  /// longer ones are tried with an axis that turns, ever longer while that succeeds.
  template <class Left>
  bool meets(double from, double to, const Left& left) {
    double t = from, last_step = 1, stretch = 2;
    Vec3 axis = axis_at(t);
    for (int steps = 0; steps < kMaxSteps; ++steps) {
      const double until = separated_until(motion_, axis, t, separation_);
      if (until >= to) return false;
      const double step = until - t;
      if (step <= tolerance_) break;
      double next = until;
      if (step > kSlow * last_step) {
        const double ahead = std::min(to, t + stretch * step);
        const Vec3 turned = axis_at(ahead);
        if (separated_between(motion_, axis, t, turned, ahead, separation_)) {
          if (ahead >= to) return false;
          next = ahead, axis = turned, stretch *= 2;
        } else {
          stretch = 2;
        }
      }
      if (next == until) axis = axis_at(until);
      last_step = step, t = next;
      result_.additive = true;
      if (left(t)) return false;
    }
    result_.hit = true;
    result_.time = t;
    return true;
  }

  /// Contact in the part of the monotone piece [low, high] in which f may be zero.
  bool meets_when_coplanar(const Coplanarity& plane, double low, double high) {
    const double at_low = plane.f(low), at_high = plane.f(high);
    result_.evaluations += 2;
    const double sign = at_low < 0 ? -1 : 1;
    if (sign * at_low > plane.error) {
      if (sign * at_high > plane.error) return false;
      Cubic above = plane.f;
      for (double& c : above.c) c *= sign;
      above.c[0] -= plane.error;
      low = last_above_zero(above, low, high, options_, tolerance_, result_.evaluations);
    }
    return meets(low, high, [&](double t) { return std::abs(plane.f(t)) > plane.error; });
  }

  [[nodiscard]] const CcdResult& result() const { return result_; }

 private:
  /// Unit vector between the closest points, NaN if they coincide.
  Vec3 axis_at(double t) {
    ++result_.evaluations;
    const Closest c = closest(motion_.kind, points_at(motion_, t));
    return c.offset / std::sqrt(c.distance_sq);
  }

  const Motion& motion_;
  const CcdOptions& options_;
  double separation_;
  double tolerance_;
  CcdResult result_;
};

}  // namespace

CcdResult first_contact(PairKind kind, const PairPoints& start, const PairPoints& end,
                        const CcdOptions& options) {
  const Motion motion = relative_motion(kind, start, end);
  if (!motion.computable) return {.hit = true, .time = 0};
  const double separation = std::max(0.0, options.min_separation);
  if (separated_until(motion, axis_between_centres(motion), 0, separation) >= 1)
    return {.evaluations = 1};
  Search search(motion, options, separation);
  if (separation > 0 || options.method == CcdMethod::Additive) {
    search.meets(0, 1, [](double) { return false; });
    return search.result();
  }
  const Coplanarity plane = coplanarity(motion);
  if (plane.never) return {.evaluations = 1};
  const Pieces pieces = monotone_pieces(plane.f);
  for (std::size_t i = 0; i < pieces.count; ++i)
    if (search.meets_when_coplanar(plane, pieces.ends[i], pieces.ends[i + 1])) break;
  return search.result();
}

void first_contacts(std::span<const CcdQuery> queries, const CcdOptions& options,
                    std::span<CcdResult> results) {
  PIECEWORK_ASSERT(queries.size() == results.size());
  parallel_for(queries.size(), [&](std::size_t i) {
    const CcdQuery& q = queries[i];
    results[i] = first_contact(q.kind, q.start, q.end, options);
  });
}

}  // namespace piecework::collision
