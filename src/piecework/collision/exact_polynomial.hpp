#pragma once

// Polynomials with integer coefficients and their real roots in [0, 1], without any rounding. The
// arithmetic of the oracle of ccd_oracle.hpp, for tests and benchmarks.

#include <vector>

#include <gmpxx.h>

namespace piecework::collision::exact {

/// c[0] + c[1] t + ..., without leading zeros; zero has no coefficients.
class Polynomial {
 public:
  Polynomial() = default;
  explicit Polynomial(std::vector<mpz_class> coefficients);

  [[nodiscard]] bool is_zero() const { return c_.empty(); }
  [[nodiscard]] std::size_t degree() const { return c_.size() - 1; }  ///< of a non-zero one
  [[nodiscard]] const std::vector<mpz_class>& coefficients() const { return c_; }

  friend Polynomial operator+(const Polynomial& a, const Polynomial& b);
  friend Polynomial operator-(const Polynomial& a, const Polynomial& b);
  friend Polynomial operator*(const Polynomial& a, const Polynomial& b);

 private:
  std::vector<mpz_class> c_;
};

/// Greatest common divisor, up to a factor.
Polynomial gcd(Polynomial a, Polynomial b);

/// p without repeated factors: the same roots, each once.
Polynomial squarefree(const Polynomial& p);

/// One root alpha of a squarefree polynomial in [0, 1]: known exactly, as numerator / 2^bits, or
/// the only one in the open interval (numerator, numerator + 1) / 2^bits.
class Root {
 public:
  /// \param local  the polynomial over the interval, as one over (0, 1), not zero at 0
  Root(Polynomial whole, Polynomial local, mpz_class numerator, unsigned bits);
  /// The exact root.
  Root(Polynomial whole, mpz_class numerator, unsigned bits);

  /// Sign of p(alpha): -1, 0 or 1.
  int sign_of(const Polynomial& p);

  /// The largest double that is no larger than alpha.
  double floor();

 private:
  void refine();
  [[nodiscard]] bool is_root_of(const Polynomial& p);

  Polynomial whole_, local_;
  mpz_class numerator_;
  unsigned bits_;
  bool exact_;
};

/// Distinct roots of p, which is not zero, in [0, 1], ascending.
std::vector<Root> roots_in_unit_interval(const Polynomial& p);

}  // namespace piecework::collision::exact
