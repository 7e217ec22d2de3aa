// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace veneer::capture {
namespace {

using ::testing::HasSubstr;

Error error_of(const std::string& text) {
  auto toml = TomlReader::parse(text, "rig.toml");
  VENEER_CHECK(toml.has_value());
  const auto camera = open_camera(*toml);
  return camera ? Error{Errc::kIo, "no error"} : camera.error();
}

TEST(Cameras, AnUnknownDriverIsRefusedWithThoseThatThereAre) {
  for (const std::string text : {"", "driver = \"webcam\""}) {
    const Error error = error_of(text);
    EXPECT_EQ(error.code, Errc::kInvalidOption);
    for (const CameraDriver& driver : camera_drivers()) {
      EXPECT_THAT(error.what, HasSubstr(fmt::format("\"{}\"", driver.name)));
    }
  }
}

TEST(Cameras, EveryDriverSaysWhatItIs) {
  for (const CameraDriver& driver : camera_drivers()) {
    EXPECT_FALSE(driver.summary.empty()) << driver.name;
    EXPECT_NE(driver.open, nullptr) << driver.name;
    EXPECT_NE(driver.list, nullptr) << driver.name;
  }
}

}  // namespace
}  // namespace veneer::capture
