#include <piecework/collision/exact_polynomial.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace piecework::collision::exact {
namespace {

using Coefficients = std::vector<mpz_class>;

/// p(t + 1).
Polynomial shifted_by_one(const Polynomial& p) {
  Coefficients c = p.coefficients();
  for (std::size_t i = 0; i + 1 < c.size(); ++i)
    for (std::size_t j = c.size() - 1; j-- > i;) c[j] += c[j + 1];
  return Polynomial(std::move(c));
}

/// 2^degree p(t / 2): the left half of (0, 1), stretched.
Polynomial left_half(const Polynomial& p) {
  Coefficients c = p.coefficients();
  for (std::size_t i = 0; i < c.size(); ++i) c[i] <<= c.size() - 1 - i;
  return Polynomial(std::move(c));
}

/// Sign changes of the coefficients of (1 + t)^degree p(1 / (1 + t)). By Descartes' rule 0 and 1
/// are the numbers of roots in (0, 1); more may be too many.
int variations(const Polynomial& p) {
  Coefficients reversed(p.coefficients().rbegin(), p.coefficients().rend());
  // Leading coefficients that vanish (a root at 0) are no sign changes.
  const Polynomial q = shifted_by_one(Polynomial(std::move(reversed)));
  int changes = 0, last = 0;
  for (const mpz_class& c : q.coefficients()) {
    const int sign = sgn(c);
    if (sign != 0 && last != 0 && sign != last) ++changes;
    if (sign != 0) last = sign;
  }
  return changes;
}

Polynomial derivative(const Polynomial& p) {
  Coefficients c;
  for (std::size_t i = 1; i < p.coefficients().size(); ++i)
    c.push_back(p.coefficients()[i] * static_cast<unsigned long>(i));
  return Polynomial(std::move(c));
}

Polynomial primitive(const Polynomial& p) {
  mpz_class content = 0;
  for (const mpz_class& c : p.coefficients()) content = ::gcd(content, c);
  if (content <= 1) return p;
  Coefficients c = p.coefficients();
  for (mpz_class& x : c) x /= content;
  return Polynomial(std::move(c));
}

struct Division {
  Polynomial quotient, remainder;
};

/// q and r with factor a = q b + r, deg r < deg b, for some integer factor.
Division pseudo_divide(const Polynomial& a, const Polynomial& b) {
  Division d{{}, a};
  const Polynomial lead(Coefficients{b.coefficients().back()});
  while (!d.remainder.is_zero() && d.remainder.degree() >= b.degree()) {
    Coefficients term(d.remainder.degree() - b.degree() + 1);
    term.back() = d.remainder.coefficients().back();
    const Polynomial t(std::move(term));
    d.quotient = d.quotient * lead + t;
    d.remainder = d.remainder * lead - b * t;
  }
  return d;
}

/// 2^(bits degree) p(numerator / 2^bits).
mpz_class scaled_value(const Polynomial& p, const mpz_class& numerator, unsigned bits) {
  mpz_class sum = 0;
  const auto& c = p.coefficients();
  for (std::size_t i = c.size(); i-- > 0;) {
    sum *= numerator;
    sum += c[i] << static_cast<unsigned long>(bits * (c.size() - 1 - i));
  }
  return sum;
}

/// Appends the roots in [numerator, numerator + 1) / 2^bits.
void isolate(const Polynomial& whole, Polynomial p, const mpz_class& numerator, unsigned bits,
             std::vector<Root>& roots) {
  if (sgn(p.coefficients().front()) == 0) {
    roots.emplace_back(whole, numerator, bits);
    p = Polynomial(Coefficients(p.coefficients().begin() + 1, p.coefficients().end()));
  }
  const int changes = variations(p);
  if (changes == 0) return;
  if (changes == 1) {
    roots.emplace_back(whole, std::move(p), numerator, bits);
    return;
  }
  const Polynomial left = left_half(p);
  isolate(whole, left, 2 * numerator, bits + 1, roots);
  isolate(whole, shifted_by_one(left), 2 * numerator + 1, bits + 1, roots);
}

}  // namespace

Polynomial::Polynomial(std::vector<mpz_class> coefficients) : c_(std::move(coefficients)) {
  while (!c_.empty() && sgn(c_.back()) == 0) c_.pop_back();
}

Polynomial operator+(const Polynomial& a, const Polynomial& b) {
  Coefficients c(std::max(a.c_.size(), b.c_.size()));
  for (std::size_t i = 0; i < a.c_.size(); ++i) c[i] += a.c_[i];
  for (std::size_t i = 0; i < b.c_.size(); ++i) c[i] += b.c_[i];
  return Polynomial(std::move(c));
}

Polynomial operator-(const Polynomial& a, const Polynomial& b) {
  Coefficients c(std::max(a.c_.size(), b.c_.size()));
  for (std::size_t i = 0; i < a.c_.size(); ++i) c[i] += a.c_[i];
  for (std::size_t i = 0; i < b.c_.size(); ++i) c[i] -= b.c_[i];
  return Polynomial(std::move(c));
}

Polynomial operator*(const Polynomial& a, const Polynomial& b) {
  if (a.is_zero() || b.is_zero()) return {};
  Coefficients c(a.c_.size() + b.c_.size() - 1);
  for (std::size_t i = 0; i < a.c_.size(); ++i)
    for (std::size_t j = 0; j < b.c_.size(); ++j) c[i + j] += a.c_[i] * b.c_[j];
  return Polynomial(std::move(c));
}

Polynomial gcd(Polynomial a, Polynomial b) {
  while (!b.is_zero()) a = std::exchange(b, primitive(pseudo_divide(a, b).remainder));
  return primitive(a);
}

Polynomial squarefree(const Polynomial& p) {
  const Polynomial slope = derivative(p);
  if (slope.is_zero()) return p;
  const Polynomial repeated = gcd(p, slope);
  return repeated.degree() == 0 ? p : primitive(pseudo_divide(p, repeated).quotient);
}

Root::Root(Polynomial whole, Polynomial local, mpz_class numerator, unsigned bits)
    : whole_(std::move(whole)),
      local_(std::move(local)),
      numerator_(std::move(numerator)),
      bits_(bits),
      exact_(false) {}

Root::Root(Polynomial whole, mpz_class numerator, unsigned bits)
    : whole_(std::move(whole)), numerator_(std::move(numerator)), bits_(bits), exact_(true) {}

/// Halves the interval.
void Root::refine() {
  if (exact_) return;
  const Polynomial left = left_half(local_), right = shifted_by_one(left);
  const int middle = sgn(right.coefficients().front());
  ++bits_;
  numerator_ *= 2;
  if (middle == sgn(left.coefficients().front()) || middle == 0) ++numerator_;
  if (middle == 0)
    exact_ = true;
  else
    local_ = middle == sgn(left.coefficients().front()) ? right : left;
}

/// The common factor of p and the own polynomial has alpha for a root, or none in the interval.
bool Root::is_root_of(const Polynomial& p) {
  const Polynomial common = gcd(whole_, p);
  if (common.degree() == 0) return false;
  for (;; refine()) {
    const int low = sgn(scaled_value(common, numerator_, bits_));
    if (exact_) return low == 0;
    const int high = sgn(scaled_value(common, numerator_ + 1, bits_));
    if (low != 0 && high != 0) return low != high;  // an end may be another root: go on
  }
}

int Root::sign_of(const Polynomial& p) {
  if (p.is_zero()) return 0;
  mpz_class steepest = 0;  // bounds |p'| on [0, 1]
  for (std::size_t i = 1; i < p.coefficients().size(); ++i)
    steepest += abs(p.coefficients()[i]) * static_cast<unsigned long>(i);
  constexpr unsigned kBitsBeforeGcd = 160;
  for (bool coprime = false;; refine()) {
    const mpz_class value = scaled_value(p, numerator_, bits_);
    if (exact_) return sgn(value);
    const auto scale = static_cast<unsigned long>(bits_ * p.degree());
    if ((abs(value) << bits_) > (steepest << scale)) return sgn(value);
    if (bits_ < kBitsBeforeGcd || coprime) continue;
    if (is_root_of(p)) return 0;
    coprime = true;
  }
}

double Root::floor() {
  const auto rounded_down = [](const mpz_class& numerator, unsigned bits) {
    mpq_class q(numerator, mpz_class(1) << bits);
    q.canonicalize();
    return std::pair{q.get_d(), q};  // get_d() truncates
  };
  for (;; refine()) {
    const auto [low, low_exactly] = rounded_down(numerator_, bits_);
    if (exact_) return low;
    const auto [high, high_exactly] = rounded_down(numerator_ + 1, bits_);
    if (low == high) return low;
    // alpha is below the upper end, which is a double, the next one.
    if (high_exactly == high && std::nextafter(low, 2.0) == high) return low;
  }
}

std::vector<Root> roots_in_unit_interval(const Polynomial& p) {
  std::vector<Root> roots;
  if (p.degree() == 0) return roots;
  const Polynomial simple = squarefree(p);
  isolate(simple, simple, 0, 0, roots);
  mpz_class at_one = 0;
  for (const mpz_class& c : simple.coefficients()) at_one += c;
  if (sgn(at_one) == 0) roots.emplace_back(simple, 1, 0);
  return roots;
}

}  // namespace piecework::collision::exact
