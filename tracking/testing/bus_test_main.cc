// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>

#include "tracking/testing/mock_bus.h"

/// The main of tests on the mocked bus (veneer_add_bus_test).
int main(int argc, char** argv) {
  constexpr int kSkipped = 77;
  ::testing::InitGoogleTest(&argc, argv);
  if (!veneer::tracking::mock::Bus::instance().is_mocked()) {
    std::puts("skipped: start it as umockdev-wrapper PROGRAM");
    return kSkipped;
  }
  return RUN_ALL_TESTS();
}
