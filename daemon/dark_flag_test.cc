// SPDX-License-Identifier: Apache-2.0
#include "daemon/dark_flag.h"

#include <gtest/gtest.h>

#include "base/testing/temporary_folder.h"

namespace veneer::daemon {
namespace {

TEST(DarkFlag, IsAsItWasPutLastWhoeverLooks) {
  const TemporaryFolder folder;
  const DarkFlag flag(folder.path());
  EXPECT_FALSE(flag.is_up());
  for (const bool up : {true, true, false, false, true}) {
    const Status put = flag.put(up);
    ASSERT_TRUE(put) << put.error().what;
    EXPECT_EQ(flag.is_up(), up);
    EXPECT_EQ(DarkFlag(folder.path()).is_up(), up) << "the next process";
  }
}

TEST(DarkFlag, IsNothingWithoutAFolder) {
  const DarkFlag flag{{}};
  EXPECT_TRUE(flag.put(true));
  EXPECT_FALSE(flag.is_up());
  EXPECT_TRUE(flag.put(false));
}

TEST(DarkFlag, SaysWhatCannotBeRemembered) {
  const TemporaryFolder folder;
  const DarkFlag flag(folder.path() / "gone");
  const Status up = flag.put(true);
  ASSERT_FALSE(up);
  EXPECT_EQ(up.error().code, Errc::kIo);
  EXPECT_NE(up.error().what.find("gone/dark"), std::string::npos) << up.error().what;
  EXPECT_FALSE(flag.is_up());
  EXPECT_TRUE(flag.put(false)) << "it is down";
}

TEST(DarkFlag, FollowsNoLink) {
  const TemporaryFolder folder;
  std::filesystem::create_symlink(folder.path() / "elsewhere", folder.path() / DarkFlag::kFile);
  EXPECT_FALSE(DarkFlag(folder.path()).put(true));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "elsewhere"));
  EXPECT_TRUE(DarkFlag(folder.path()).is_up()) << "on any doubt it is dark";
}

}  // namespace
}  // namespace veneer::daemon
