// SPDX-License-Identifier: Apache-2.0
#include "projector/controls.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <string>

#include "base/testing/temporary_folder.h"
#include "projector/control/pjlink/pjlink.h"

namespace veneer::projector {
namespace {

using ::testing::HasSubstr;

Result<std::unique_ptr<ProjectorControl>> control_of(const std::string& text) {
  static VirtualClock clock;
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "test"));
  VENEER_ASSIGN(std::unique_ptr<ProjectorControl> control, open_control(toml, clock));
  VENEER_TRY(toml.finish());
  return control;
}

TEST(Controls, AreSortedAndSayWhatTheyAre) {
  EXPECT_TRUE(std::ranges::is_sorted(control_drivers(), {}, &ControlDriver::name));
  for (const ControlDriver& driver : control_drivers())
    EXPECT_FALSE(driver.summary.empty()) << driver.name;
}

TEST(Controls, AnUnknownNameIsRefusedWithTheKnownOnes) {
  for (const char* text : {"", "driver = \"\"", "driver = \"rs232\""}) {
    const auto control = control_of(text);
    ASSERT_FALSE(control) << text;
    EXPECT_EQ(control.error().code, Errc::kInvalidOption);
    for (const ControlDriver& driver : control_drivers())
      EXPECT_THAT(control.error().what, HasSubstr(std::string(driver.name)));
  }
}

TEST(PjlinkOptions, WhatCannotBeIsRefused) {
  EXPECT_TRUE(control_of("driver = \"pjlink\"\nhost = \"a\""));  // connects to nothing yet
  for (const char* text : {"",
                           "host = \"\"",
                           "host = \"a\"\nport = 0",
                           "host = \"a\"\nport = 65536",
                           "host = \"a\"\ntime_limit_s = 0.0",
                           "host = \"a\"\ntime_limit_s = -1.0",
                           "host = \"a\"\ntime_limit_s = nan",
                           "host = \"a\"\ntime_limit_s = inf",
                           "host = \"a\"\nhots = \"b\"",
                           "host = \"a\"\npassword = \"p\"\npassword_file = \"f\""}) {
    const auto control = control_of("driver = \"pjlink\"\n" + std::string(text));
    ASSERT_FALSE(control) << text;
    EXPECT_EQ(control.error().code, Errc::kInvalidOption) << text;
  }
  const auto control =
      control_of("driver = \"pjlink\"\nhost = \"a\"\npassword_file = \"/nowhere\"");
  ASSERT_FALSE(control);
  EXPECT_EQ(control.error().code, Errc::kNotFound);
}

TEST(PjlinkOptions, ThePasswordIsTheFirstLineOfItsFile) {
  const TemporaryFolder folder;
  for (const char* content : {"secret", "secret\n", "secret\r\nmore\n"}) {
    std::ofstream(folder.path() / "password", std::ios::binary) << content;
    std::ofstream(folder.path() / "control.toml") << "host = \"a\"\npassword_file = \"password\"\n";
    auto toml = TomlReader::open(folder.path() / "control.toml");
    ASSERT_TRUE(toml);
    const auto options = PjlinkOptions::read(*toml);
    ASSERT_TRUE(options) << options.error().what;
    EXPECT_EQ(options->password, "secret");
  }
}

TEST(PjlinkOptions, APasswordFileThatIsNoneIsRefusedAndNotReadForEver) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "empty").flush();
  std::ofstream(folder.path() / "long") << std::string(257, 'x');
  std::ofstream(folder.path() / "longest") << std::string(256, 'x') << "\nmore";
  const auto control_with = [&](const std::string& file) {
    return control_of("driver = \"pjlink\"\nhost = \"a\"\npassword_file = \"" + file + "\"");
  };
  for (const std::string& file : {std::string("/dev/zero"),
                                  folder.path().string(),
                                  (folder.path() / "empty").string(),
                                  (folder.path() / "long").string()}) {
    const auto control = control_with(file);
    ASSERT_FALSE(control) << file;
    EXPECT_EQ(control.error().code, Errc::kNotFound);
    EXPECT_THAT(control.error().what, HasSubstr("first line"));
  }
  EXPECT_TRUE(control_with((folder.path() / "longest").string()));
}

}  // namespace
}  // namespace veneer::projector
