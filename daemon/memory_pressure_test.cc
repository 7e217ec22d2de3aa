// SPDX-License-Identifier: Apache-2.0
#include "daemon/memory_pressure.h"

#include <gtest/gtest.h>

namespace veneer::daemon {
namespace {

TEST(MemoryPressure, IsTheKernelsPercentageAsAPart) {
  constexpr const char* kText =
      "some avg10=12.50 avg60=3.00 avg300=0.70 total=12345\n"
      "full avg10=99.00 avg60=0.00 avg300=0.00 total=1\n";
  EXPECT_DOUBLE_EQ(parse_memory_pressure(kText).value(), 0.125);
  EXPECT_EQ(parse_memory_pressure("some avg10=0.00 avg60=0\n").value(), 0);
  EXPECT_EQ(parse_memory_pressure("some avg10=100.00\n").value(), 1);
}

TEST(MemoryPressure, RefusesWhatIsNone) {
  for (const char* text : {"",
                           "some avg10=",
                           "some avg10=x",
                           "some avg10=-1",
                           "some avg10=101",
                           "some avg10=nan",
                           "full avg10=3.0"}) {
    EXPECT_EQ(parse_memory_pressure(text).error().code, Errc::kBadFormat) << text;
  }
}

}  // namespace
}  // namespace veneer::daemon
