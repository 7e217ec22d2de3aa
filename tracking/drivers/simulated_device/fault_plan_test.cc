// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated_device/fault_plan.h"

#include <gtest/gtest.h>

#include <string>

namespace veneer::tracking {
namespace {

Status read(const std::string& keys) {
  TomlReader toml = TomlReader::parse("[[fault]]\n" + keys, "test").value();
  (void)read_faults(toml);
  return toml.finish();
}

TEST(FaultPlan, ReadsWhatCanStrike) {
  EXPECT_TRUE(read("kind = \"drop\"\nat_s = 1\nfor_s = 0.5\nbody = 2"));
  EXPECT_TRUE(read("kind = \"clock-restart\"\nat_s = 1"));
  EXPECT_EQ(name_of(FaultKind::kBitFlip), "bit-flip");
}

TEST(FaultPlan, RefusesWhatNeverWould) {
  // A plan whose fault does nothing would pass whatever it expects.
  for (const char* keys : {"kind = \"drop\"\nat_s = 1",
                           "kind = \"silence\"\nat_s = 1\nfor_s = 1\nbody = 1",
                           "kind = \"drop\"\nfor_s = 1",
                           "kind = \"dorp\"\nat_s = 1\nfor_s = 1",
                           "kind = \"drop\"\nat_s = -1\nfor_s = 1",
                           "kind = \"drop\"\nat_s = 1\nfor_s = 1\nshare = 2",
                           "kind = \"thin\"\nat_s = 1\nfor_s = 1\nsamples = 0"}) {
    EXPECT_FALSE(read(keys)) << keys;
  }
}

}  // namespace
}  // namespace veneer::tracking
