#include "fare.h"

#include <gtest/gtest.h>

namespace nodal::planted {
namespace {

// No test has a negative age, or 0: of six changes of fare(), two are unnoticed, and tests/mutants/run must name them.
TEST(Fare, AgesAroundEighteen_PayHalfAndAll) {
  EXPECT_EQ(fare(17), 5);
  EXPECT_EQ(fare(18), 10);
}

}  // namespace
}  // namespace nodal::planted
