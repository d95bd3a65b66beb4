#include <piecework/collision/exact_polynomial.hpp>

#include <cmath>

#include <gtest/gtest.h>

namespace piecework::collision::exact {
namespace {

Polynomial polynomial(std::initializer_list<long> coefficients) {
  std::vector<mpz_class> c;
  for (const long x : coefficients) c.emplace_back(x);
  return Polynomial(std::move(c));
}

/// t - numerator / denominator, times the denominator.
Polynomial factor(long numerator, long denominator) {
  return polynomial({-numerator, denominator});
}

std::vector<double> floors(const Polynomial& p) {
  std::vector<double> values;
  for (Root& root : roots_in_unit_interval(p)) values.push_back(root.floor());
  return values;
}

TEST(ExactPolynomial, FindsEveryRootOnceInOrder) {
  const Polynomial p = factor(1, 3) * factor(1, 3) * factor(1, 4) * factor(3, 4) * factor(1, 1) *
                       factor(-1, 2) * factor(5, 2) * factor(0, 1);
  EXPECT_EQ(floors(p), (std::vector<double>{0, 0.25, 1.0 / 3, 0.75, 1}));  // 1.0 / 3 < 1 / 3
  EXPECT_TRUE(floors(polynomial({1, 0, 1})).empty());
  EXPECT_TRUE(floors(polynomial({7})).empty());
}

TEST(ExactPolynomial, SeparatesRootsThatDoublesCannot) {
  const mpz_class big = mpz_class(1) << 200;
  const Polynomial close({mpz_class(-(big / 2 + 1)), big});  // root 1/2 + 2^-200
  EXPECT_EQ(roots_in_unit_interval(factor(1, 2) * close).size(), 2U);
  const Polynomial below({mpz_class(-(big / 2 - 1)), big});
  EXPECT_EQ(floors(below).at(0), 0x1.fffffffffffffp-2);
  EXPECT_EQ(floors(close).at(0), 0.5);
}

TEST(ExactPolynomial, RootsRoundDown) {
  for (const long denominator : {3L, 7L, 1000003L, 1L << 40})
    for (const long numerator : {1L, 2L, denominator - 1}) {
      const double low = floors(factor(numerator, denominator)).at(0);
      const mpq_class exactly(numerator, denominator);
      EXPECT_TRUE(mpq_class(low) <= exactly);
      EXPECT_TRUE(mpq_class(std::nextafter(low, 2.0)) > exactly);
    }
}

TEST(ExactPolynomial, SignsAtARootAreExact) {
  const Polynomial half_of_two = polynomial({-1, 0, 2});  // sqrt(1/2)
  auto roots = roots_in_unit_interval(half_of_two * factor(1, 5));
  ASSERT_EQ(roots.size(), 2U);
  Root& root = roots[1];
  EXPECT_EQ(root.sign_of(half_of_two * factor(1, 7)), 0);
  EXPECT_EQ(root.sign_of(factor(7, 10)), 1);
  EXPECT_EQ(root.sign_of(factor(8, 10)), -1);
  EXPECT_EQ(root.sign_of(Polynomial()), 0);
  const mpz_class big = mpz_class(1) << 400;
  // sqrt(1/2) against itself cut after 200 bits.
  const mpz_class cut = sqrt(mpz_class(big / 2));
  EXPECT_EQ(root.sign_of(Polynomial({mpz_class(-cut), mpz_class(1) << 200})), 1);
  EXPECT_EQ(root.sign_of(Polynomial({mpz_class(-cut - 1), mpz_class(1) << 200})), -1);
}

TEST(ExactPolynomial, CommonFactorsAreFound) {
  const Polynomial common = factor(1, 3) * polynomial({1, 1, 1});
  const Polynomial g = gcd(common * factor(2, 5), common * factor(3, 5));
  EXPECT_EQ(g.degree(), 3U);
  EXPECT_EQ(gcd(factor(1, 3), factor(1, 4)).degree(), 0U);
  EXPECT_EQ(squarefree(common * common).degree(), 3U);
}

}  // namespace
}  // namespace piecework::collision::exact
