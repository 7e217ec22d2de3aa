// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/colorhug/colorhug_protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <initializer_list>
#include <vector>

namespace veneer::calibration::colorhug {
namespace {

using ::testing::HasSubstr;

std::vector<std::byte> bytes(std::initializer_list<int> values, std::size_t size = kReportSize) {
  std::vector<std::byte> result;
  for (const int value : values) result.push_back(static_cast<std::byte>(value));
  result.resize(size);
  return result;
}

std::vector<std::byte> as_vector(const Report& report) { return {report.begin(), report.end()}; }

TEST(ColorHugProtocol, RequestsAreTheCommandAndItsDataAndZeros) {
  EXPECT_EQ(as_vector(take_reading_request(66)), bytes({0x23, 0x42, 0x00}));
  EXPECT_EQ(as_vector(take_reading_request(0x0102)), bytes({0x23, 0x02, 0x01}));
  EXPECT_EQ(as_vector(firmware_version_request()), bytes({0x07}));
  EXPECT_EQ(as_vector(serial_number_request()), bytes({0x0B}));
}

TEST(ColorHugProtocol, ReadingsAreFixedPointNumbersOfBothSigns) {
  const auto xyz = reading_xyz(
      bytes({0x00, 0x23, 0x00, 0x80, 0x23, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0x01, 0x00, 0x00, 0x80}));
  ASSERT_TRUE(xyz);
  EXPECT_EQ(*xyz, Xyz(35.5, -1.0 / 65536, -32768 + 1.0 / 65536));
}

TEST(ColorHugProtocol, VersionAndSerialNumberAreLittleEndian) {
  const auto version = firmware_version(bytes({0, 7, 2, 0, 0, 1, 7, 0}));
  ASSERT_TRUE(version);
  EXPECT_EQ(version->major, 2);
  EXPECT_EQ(version->minor, 256);
  EXPECT_EQ(version->micro, 7);
  const auto serial = serial_number(bytes({0, 0x0B, 0x04, 0x03, 0x02, 0xF1}));
  ASSERT_TRUE(serial);
  EXPECT_EQ(*serial, 0xF1020304U);
}

TEST(ColorHugProtocol, ARepliesKindIsItsFirstTwoBytes) {
  constexpr auto kCommand = Command::kTakeReadingXyz;
  EXPECT_EQ(kind_of(bytes({0x00, 0x23}), kCommand), ReplyKind::kDone);
  EXPECT_EQ(kind_of(bytes({0x12, 0x23}), kCommand), ReplyKind::kIncomplete);
  EXPECT_EQ(kind_of(bytes({0x00, 0x07}), kCommand), ReplyKind::kStray);
  EXPECT_EQ(kind_of(bytes({0x0F, 0x07}), kCommand), ReplyKind::kStray);
  EXPECT_EQ(kind_of({}, kCommand), ReplyKind::kStray);
  EXPECT_EQ(kind_of(bytes({0x00}, 1), kCommand), ReplyKind::kStray);
  for (int value = 1; value < 256; ++value)
    if (value != 0x12) {
      EXPECT_EQ(kind_of(bytes({value, 0x23}), kCommand), ReplyKind::kFailed) << value;
      EXPECT_THAT(failure_of(bytes({value, 0x23})).what, HasSubstr("reading a ColorHug")) << value;
    }
}

TEST(ColorHugProtocol, FailuresSayWhatToDo) {
  EXPECT_THAT(failure_of(bytes({0x0C, 0x23})).what, HasSubstr("no calibration"));
  EXPECT_THAT(failure_of(bytes({0x0F, 0x23})).what, HasSubstr("too much light"));
  EXPECT_THAT(failure_of(bytes({0x04, 0x23})).what, HasSubstr("too little light"));
  EXPECT_THAT(failure_of(bytes({0x33, 0x23})).what, HasSubstr("0x33"));
}

TEST(ColorHugProtocol, ShortRepliesAreRefusedAtEveryLength) {
  for (std::size_t size = 0; size < 14; ++size) {
    EXPECT_FALSE(reading_xyz(bytes({}, size))) << size;
    EXPECT_EQ(firmware_version(bytes({}, size)).has_value(), size >= 8) << size;
    EXPECT_EQ(serial_number(bytes({}, size)).has_value(), size >= 6) << size;
  }
  EXPECT_TRUE(reading_xyz(bytes({}, 14)));
}

}  // namespace
}  // namespace veneer::calibration::colorhug
