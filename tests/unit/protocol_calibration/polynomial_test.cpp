#include "protocol/base/polynomial.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <cmath>

namespace nodal {
namespace {

/// The coefficients of prod (x - root).
std::vector<double> with_roots(const std::vector<double>& roots) {
  std::vector<double> c{1.0};
  for (const double root : roots) {
    std::vector<double> next(c.size() + 1, 0.0);
    for (std::size_t k = 0; k < c.size(); ++k) {
      next[k + 1] += c[k];
      next[k] -= root * c[k];
    }
    c = next;
  }
  return c;
}

TEST(Polynomial, KnownRoots_AreFoundInOrderAndOnlyThoseInTheInterval) {
  const std::vector<double> c = with_roots({-3, 0.5, 1, 2, 7});
  const std::vector<double> roots = polynomial_roots(c, 0, 5);
  ASSERT_EQ(roots.size(), 3u);
  EXPECT_NEAR(roots[0], 0.5, 1e-12);
  EXPECT_NEAR(roots[1], 1, 1e-12);
  EXPECT_NEAR(roots[2], 2, 1e-12);
}

TEST(Polynomial, RootThatOnlyTouchesZero_IsFound) {
  const std::vector<double> c = with_roots({2, 2});
  const std::vector<double> roots = polynomial_roots(c, 0, 10);
  ASSERT_EQ(roots.size(), 1u);
  EXPECT_DOUBLE_EQ(roots[0], 2);
}

TEST(Polynomial, RootAtAnEndOfTheInterval_IsFoundOnce) {
  for (const double slope : {1.0, -1.0}) {
    EXPECT_EQ(polynomial_roots(std::vector<double>{0, slope}, 0, 5), (std::vector<double>{0}));
    EXPECT_EQ(polynomial_roots(std::vector<double>{0, slope}, -5, 0), (std::vector<double>{0}));
  }
}

TEST(Polynomial, ConstantAndZero_HaveNoRoots) {
  EXPECT_TRUE(polynomial_roots(std::vector<double>{3}, -1, 1).empty());
  EXPECT_TRUE(polynomial_roots(std::vector<double>{0, 0, 0}, -1, 1).empty());
  EXPECT_TRUE(polynomial_roots(std::vector<double>{}, -1, 1).empty());
}

TEST(Polynomial, CubicLens_TurnsWhereItsDerivativeVanishes) {
  // r = x - x^3 / 3 turns at x = 1, where it is 2/3.
  const std::vector<double> c{0, 1, 0, -1.0 / 3};
  EXPECT_DOUBLE_EQ(rising_until(c, 10), 1);
  EXPECT_DOUBLE_EQ(rising_until(c, 0.5), 0.5);
  EXPECT_DOUBLE_EQ(polynomial_value(c, 1), 2.0 / 3);
}

TEST(Polynomial, FallingFromTheStart_RisesNowhere) {
  EXPECT_EQ(rising_until(std::vector<double>{0, -1, 5}, 10), 0);
  EXPECT_EQ(rising_until(std::vector<double>{0, 0, 5}, 10), 0);
}

TEST(Polynomial, Parabola_HasItsMinimumAtItsVertex) {
  const std::vector<double> c{5, -4, 1};  // (x - 2)^2 + 1
  EXPECT_DOUBLE_EQ(polynomial_minimum(c, 0, 10), 1);
  EXPECT_DOUBLE_EQ(polynomial_minimum(c, 3, 10), 2);
  EXPECT_DOUBLE_EQ(polynomial_minimum(c, 0, 1), 2);
}

RC_GTEST_PROP(Polynomial, WellSeparatedRoots_AreAllFound, ()) {
  std::vector<double> roots;
  double at = 0;
  const int count = *rc::gen::inRange(1, 7);
  for (int k = 0; k < count; ++k) {
    at += 0.3 + 0.001 * *rc::gen::inRange(0, 1000);
    roots.push_back(at);
  }
  const std::vector<double> found = polynomial_roots(with_roots(roots), 0, 20);
  RC_ASSERT(found.size() == roots.size());
  for (std::size_t k = 0; k < roots.size(); ++k) RC_ASSERT(std::abs(found[k] - roots[k]) < 1e-6);
}

}  // namespace
}  // namespace nodal
