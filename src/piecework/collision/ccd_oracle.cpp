#include <piecework/collision/ccd_oracle.hpp>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <piecework/collision/exact_polynomial.hpp>

namespace piecework::collision {
namespace {

using exact::Polynomial;
using exact::Root;

/// A point in motion, or a direction.
using Vector = std::array<Polynomial, 3>;

Vector operator-(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

Polynomial dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Two features: contact at the roots of `distance` where all of `inside` are >= 0 and `proper` is
/// > 0 (the face has an area, the edge a length).
struct Features {
  Polynomial distance;
  std::vector<Polynomial> inside;
  Polynomial proper;
};

/// The pair with all coordinates multiplied by a power of two that makes them integers.
struct IntegerPair {
  PairKind kind;
  std::array<Vector, 4> x;
  mpz_class separation_sq;
};

/// The exponent of the last bit of a double that is not zero.
int last_bit(double value) {
  int exponent = 0;
  const double mantissa = std::frexp(value, &exponent);
  auto digits = static_cast<std::int64_t>(std::ldexp(std::abs(mantissa), 53));
  exponent -= 53;
  for (; digits % 2 == 0; digits /= 2) ++exponent;
  return exponent;
}

mpz_class integer(double value, int exponent) {
  if (value == 0) return 0;
  const int last = last_bit(value);
  const mpz_class digits(std::ldexp(value, -last));
  return digits << static_cast<unsigned long>(last - exponent);
}

IntegerPair to_integers(const CcdQuery& q, double separation) {
  int exponent = 2000;
  const auto include = [&](double value) {
    if (value != 0) exponent = std::min(exponent, last_bit(value));
  };
  for (const PairPoints* side : {&q.start, &q.end})
    for (const Vec3& p : *side)
      for (int k = 0; k < 3; ++k) include(p[k]);
  include(separation);
  IntegerPair pair{q.kind, {}, integer(separation, exponent)};
  pair.separation_sq *= mpz_class(pair.separation_sq);
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const mpz_class a = integer(q.start[i][static_cast<int>(k)], exponent);
      const mpz_class b = integer(q.end[i][static_cast<int>(k)], exponent);
      pair.x[i][k] = Polynomial({a, b - a});
    }
  return pair;
}

Polynomial times(const Polynomial& p, const mpz_class& factor) { return p * Polynomial({factor}); }

/// The inside of the triangle or of both edges.
Features faces(const IntegerPair& p) {
  const auto& x = p.x;
  Features f;
  Vector normal;
  if (p.kind == PairKind::VertexTriangle) {
    const Vector e1 = x[2] - x[1], e2 = x[3] - x[1], r = x[0] - x[1];
    normal = cross(e1, e2);
    const Polynomial b2 = dot(cross(r, e2), normal), b3 = dot(cross(e1, r), normal);
    f.proper = dot(normal, normal);
    f.inside = {b2, b3, f.proper - b2 - b3};
    f.distance = dot(r, normal);
  } else {
    const Vector e = x[1] - x[0], g = x[3] - x[2], r = x[2] - x[0];
    normal = cross(e, g);
    const Polynomial s = dot(cross(r, g), normal), u = dot(cross(r, e), normal);
    f.proper = dot(normal, normal);
    f.inside = {s, f.proper - s, u, f.proper - u};
    f.distance = dot(r, normal);
  }
  if (p.separation_sq != 0) f.distance = f.distance * f.distance - times(f.proper, p.separation_sq);
  return f;
}

Features vertex_and_edge(const IntegerPair& p, const Vector& vertex, const Vector& a,
                         const Vector& b) {
  const Vector to_a = vertex - a, to_b = vertex - b, edge = b - a;
  const Vector area = cross(to_a, to_b);
  const Polynomial length_sq = dot(edge, edge), along = dot(to_a, edge);
  return {
      dot(area, area) - times(length_sq, p.separation_sq), {along, length_sq - along}, length_sq};
}

Features two_vertices(const IntegerPair& p, const Vector& a, const Vector& b) {
  const Vector d = a - b;
  return {dot(d, d) - Polynomial({p.separation_sq}), {}, Polynomial({1})};
}

/// Everything but faces().
std::vector<Features> borders(const IntegerPair& p) {
  const auto& x = p.x;
  std::vector<Features> all;
  const std::size_t first_of_second = p.kind == PairKind::VertexTriangle ? 1 : 2;
  for (std::size_t i = 0; i < first_of_second; ++i)
    for (std::size_t j = first_of_second; j < 4; ++j) all.push_back(two_vertices(p, x[i], x[j]));
  if (p.kind == PairKind::VertexTriangle) {
    for (const auto& [a, b] : {std::pair{1, 2}, {2, 3}, {3, 1}})
      all.push_back(
          vertex_and_edge(p, x[0], x[static_cast<std::size_t>(a)], x[static_cast<std::size_t>(b)]));
  } else {
    for (const std::size_t i : {0, 1}) all.push_back(vertex_and_edge(p, x[i], x[2], x[3]));
    for (const std::size_t i : {2, 3}) all.push_back(vertex_and_edge(p, x[i], x[0], x[1]));
  }
  return all;
}

bool met_at_start(const Features& f) {
  const auto sign_at_start = [](const Polynomial& p) {
    return p.is_zero() ? 0 : sgn(p.coefficients().front());
  };
  return sign_at_start(f.distance) <= 0 && sign_at_start(f.proper) > 0 &&
         std::all_of(f.inside.begin(), f.inside.end(),
                     [&](const Polynomial& p) { return sign_at_start(p) >= 0; });
}

struct FirstContact {
  std::optional<double> time;
  bool improper = false;  ///< a zero of the distance without a face or an edge to speak of
};

FirstContact first_contact_of(const Features& f, bool touching) {
  // With no separation the face's "distance" is signed.
  const bool at_start =
      touching ? (f.distance.is_zero() || sgn(f.distance.coefficients().front()) == 0) &&
                     met_at_start({Polynomial(), f.inside, f.proper})
               : met_at_start(f);
  if (at_start) return {0.0};
  FirstContact first;
  if (f.distance.is_zero()) return {{}, true};
  for (Root& root : exact::roots_in_unit_interval(f.distance)) {
    if (root.sign_of(f.proper) == 0) {
      first.improper = true;
      continue;
    }
    if (std::all_of(f.inside.begin(), f.inside.end(),
                    [&](const Polynomial& p) { return root.sign_of(p) >= 0; })) {
      first.time = root.floor();
      return first;
    }
  }
  return first;
}

}  // namespace

std::optional<double> exact_first_contact(const CcdQuery& query, double min_separation) {
  const IntegerPair pair = to_integers(query, min_separation);
  const bool touching = pair.separation_sq == 0;
  FirstContact first = first_contact_of(faces(pair), touching);
  // Touching elements are coplanar, so that borders add nothing where the face is proper.
  if (touching && !first.improper) return first.time;
  for (const Features& f : borders(pair)) {
    const FirstContact other = first_contact_of(f, touching);
    if (other.time && (!first.time || *other.time < *first.time)) first.time = other.time;
  }
  return first.time;
}

CcdVerdict judge(const CcdResult& result, const std::optional<double>& exact) {
  if (!exact) return result.hit ? CcdVerdict::FalsePositive : CcdVerdict::Right;
  if (!result.hit) return CcdVerdict::Missed;
  return result.time > *exact ? CcdVerdict::Late : CcdVerdict::Right;
}

}  // namespace piecework::collision
