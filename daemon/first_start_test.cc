// SPDX-License-Identifier: Apache-2.0
#include "daemon/first_start.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

namespace veneer::daemon {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class FirstStart : public testing::Test {
 protected:
  FirstStart() {
    config_.scene = folder_ / "scene.toml";
    config_.material = folder_ / "material.safetensors";
    config_.profile = folder_ / "profile";
  }

  TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
  Config config_;
};

TEST_F(FirstStart, NamesAllThatIsMissingAndWhatMakesIt) {
  const Status status = check_files_are_there(config_);
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().code, Errc::kNotFound);
  for (const fs::path& path : {config_.scene, config_.material, config_.profile})
    EXPECT_THAT(status.error().what, HasSubstr(path.string()));
  EXPECT_THAT(status.error().what, HasSubstr("veneer fit"));
  EXPECT_THAT(status.error().what, HasSubstr("veneer calibrate"));
}

TEST_F(FirstStart, SpeaksOnlyOfWhatIsMissing) {
  ASSERT_TRUE(write_text(config_.scene, "").has_value());
  ASSERT_TRUE(write_text(config_.material, "").has_value());
  const Status status = check_files_are_there(config_);
  ASSERT_FALSE(status.has_value());
  EXPECT_THAT(status.error().what, Not(HasSubstr(config_.scene.string())));
  EXPECT_THAT(status.error().what, Not(HasSubstr("veneer fit")));
  EXPECT_THAT(status.error().what, HasSubstr(config_.profile.string()));
}

TEST_F(FirstStart, TakesOlderProfilesForOne) {
  ASSERT_TRUE(write_text(config_.scene, "").has_value());
  ASSERT_TRUE(write_text(config_.material, "").has_value());
  fs::create_directories(config_.profile.string() + ".history");
  EXPECT_TRUE(check_files_are_there(config_).has_value());
}

TEST_F(FirstStart, LeavesKeysThatAreAbsentToTheReader) {
  EXPECT_TRUE(check_files_are_there(Config{}).has_value());
}

}  // namespace
}  // namespace veneer::daemon
