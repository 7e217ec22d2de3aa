// SPDX-License-Identifier: Apache-2.0
#include "base/testing/fp_trap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <csignal>

namespace veneer {
namespace {

// Through volatile variables, so that the compiler leaves the operations to the processor.
double quotient(double a, double b) {
  volatile double above = a;
  volatile double below = b;
  volatile double result = above / below;
  return result;
}
double root(double a) {
  volatile double square = a;
  volatile double result = std::sqrt(square);
  return result;
}

// Undoes what a sanitizer does at the signal: it would report it and leave with a code of its own.
void take_the_signal_as_it_comes() { std::signal(SIGFPE, SIG_DFL); }

TEST(FpTrap, EndsTheProgramAtAnInvalidOperationAndADivisionByZero) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto dies = ::testing::KilledBySignal(SIGFPE);
  EXPECT_EXIT(
      {
        take_the_signal_as_it_comes();
        const FpTrap trap;
        quotient(0.0, 0.0);
      },
      dies,
      "");
  EXPECT_EXIT(
      {
        take_the_signal_as_it_comes();
        const FpTrap trap;
        quotient(1.0, 0.0);
      },
      dies,
      "");
  EXPECT_EXIT(
      {
        take_the_signal_as_it_comes();
        const FpTrap trap;
        root(-1.0);
      },
      dies,
      "");
}

TEST(FpTrap, LeavesRoundingAndUnderflowAlone) {
  const FpTrap trap;
  EXPECT_EQ(quotient(1e-300, 1e300), 0.0);
  EXPECT_GT(quotient(1.0, 3.0), 0.0);
}

TEST(FpTrap, EndsWithItsScope) {
  { const FpTrap trap; }
  EXPECT_TRUE(std::isnan(quotient(0.0, 0.0)));
  EXPECT_TRUE(std::isinf(quotient(1.0, 0.0)));
}

TEST(FpTrap, IsTakenAwayByAPauseAndPutBackBehindIt) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const FpTrap trap;
  {
    const FpPause pause;
    EXPECT_TRUE(std::isnan(quotient(0.0, 0.0)));
  }
  EXPECT_EXIT(
      {
        take_the_signal_as_it_comes();
        quotient(0.0, 0.0);
      },
      ::testing::KilledBySignal(SIGFPE),
      "");
}

}  // namespace
}  // namespace veneer
