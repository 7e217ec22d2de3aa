// SPDX-License-Identifier: Apache-2.0
#include "daemon/devices.h"

#include <gtest/gtest.h>

namespace veneer::daemon {
namespace {

// No folder can be made there, and the output says so before it touches any card.
TEST(Devices, TheOutputKeepsItsStateWhereTheDaemonDoes) {
  const auto toml = TomlReader::parse("[output]\ndriver = \"kms\"\n", "veneer.toml");
  ASSERT_TRUE(toml);
  const Devices devices = completed({}, *toml, "/proc/of-the-daemon");
  const auto output = devices.open_output();
  ASSERT_FALSE(output);
  EXPECT_EQ(output.error().code, Errc::kIo);
  EXPECT_NE(output.error().what.find("/proc/of-the-daemon"), std::string::npos)
      << output.error().what;
}

}  // namespace
}  // namespace veneer::daemon
