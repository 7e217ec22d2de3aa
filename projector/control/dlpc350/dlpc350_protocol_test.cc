// SPDX-License-Identifier: Apache-2.0
#include "projector/control/dlpc350/dlpc350_protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <initializer_list>

namespace veneer::projector::dlpc350 {
namespace {

using ::testing::HasSubstr;
using Step = ReplyReader::Step;

Bytes bytes(std::initializer_list<int> values, std::size_t size = 0) {
  Bytes result(std::max(size, values.size()));
  std::ranges::transform(
      values, result.begin(), [](int value) { return static_cast<std::byte>(value); });
  return result;
}

Bytes joined(const std::vector<Report>& reports) {
  Bytes all;
  for (const Report& report : reports) all.insert(all.end(), report.begin(), report.end());
  return all;
}

TEST(Dlpc350Protocol, RequestsAreAHeaderACommandAndZeros) {
  EXPECT_EQ(joined(read_request(Command::kVersion, 7)), bytes({0xC0, 7, 2, 0, 0x05, 0x02}, 64));
  EXPECT_EQ(joined(write_request(Command::kLedCurrent, 255, bytes({1, 2, 3}))),
            bytes({0x40, 255, 5, 0, 0x01, 0x0B, 1, 2, 3}, 64));
  EXPECT_EQ(joined(write_request(Command::kGamma, 0, bytes({0x80}))),
            bytes({0x40, 0, 3, 0, 0x0E, 0x1A, 0x80}, 64));
}

TEST(Dlpc350Protocol, ALongMessageGoesOnWithoutAHeader) {
  for (const std::size_t size : {57U, 58U, 59U, 122U, 123U, 300U}) {
    Bytes parameters(size);
    for (std::size_t i = 0; i < size; ++i) parameters[i] = static_cast<std::byte>(i);
    const auto reports = write_request(Command::kTestPattern, 9, parameters);
    EXPECT_EQ(reports.size(), (size + 6 + 63) / 64) << size;
    Bytes expected = bytes({0x40,
                            9,
                            static_cast<int>((size + 2) & 0xFFU),
                            static_cast<int>((size + 2) >> 8U),
                            0x03,
                            0x12});
    expected.insert(expected.end(), parameters.begin(), parameters.end());
    while (expected.size() % 64 != 0) expected.push_back(std::byte{0});
    EXPECT_EQ(joined(reports), expected) << size;
  }
}

TEST(Dlpc350Protocol, AReplyOfAnyLengthIsPutTogetherFromItsReports) {
  for (const std::size_t size : {0U, 1U, 59U, 60U, 61U, 124U, 125U, 512U}) {
    Bytes whole = bytes({0xC0, 5, static_cast<int>(size & 0xFFU), static_cast<int>(size >> 8U)});
    for (std::size_t i = 0; i < size; ++i) whole.push_back(static_cast<std::byte>(i * 7));
    const Bytes data(whole.begin() + 4, whole.end());
    while (whole.size() % 64 != 0) whole.push_back(std::byte{0});
    ReplyReader reader(5, true);
    for (std::size_t at = 0; at < whole.size(); at += 64) {
      const bool last = at + 64 == whole.size();
      EXPECT_EQ(reader.add(std::span(whole).subspan(at, 64)), last ? Step::kDone : Step::kMore);
    }
    EXPECT_EQ(reader.data(), data) << size;
  }
}

TEST(Dlpc350Protocol, OnlyTheReplyToTheRequestIsTaken) {
  EXPECT_EQ(ReplyReader(5, true).add(bytes({0xC0, 4, 0, 0}, 64)), Step::kStray);
  EXPECT_EQ(ReplyReader(5, true).add(bytes({0x40, 5, 0, 0}, 64)), Step::kStray);
  EXPECT_EQ(ReplyReader(5, false).add(bytes({0xC0, 5, 0, 0}, 64)), Step::kStray);
  EXPECT_EQ(ReplyReader(5, false).add(bytes({0x40, 5, 0, 0}, 64)), Step::kDone);
  EXPECT_EQ(ReplyReader(5, true).add(bytes({0xE0, 5, 0, 0}, 64)), Step::kRefused);
  EXPECT_EQ(ReplyReader(5, true).add(bytes({0xE0, 4, 0, 0}, 64)), Step::kStray);
  EXPECT_EQ(ReplyReader(5, false).add(bytes({0x60, 5, 0, 0}, 64)), Step::kRefused);
  for (std::size_t size = 0; size < 4; ++size)
    EXPECT_EQ(ReplyReader(0, true).add(Bytes(size)), Step::kStray) << size;
}

TEST(Dlpc350Protocol, ALengthThatCannotBeIsNotBelieved) {
  EXPECT_EQ(ReplyReader(1, true).add(bytes({0xC0, 1, 0x01, 0x02}, 64)), Step::kNonsense);
  EXPECT_EQ(ReplyReader(1, true).add(bytes({0xC0, 1, 0xFF, 0xFF}, 64)), Step::kNonsense);
  ReplyReader reader(1, true);
  EXPECT_EQ(reader.add(bytes({0xC0, 1, 100, 0}, 64)), Step::kMore);
  EXPECT_EQ(reader.add({}), Step::kNonsense);
}

TEST(Dlpc350Protocol, VersionAndLockAreWhereTheyBelong) {
  EXPECT_EQ(*read_version(bytes({0x02, 0x01, 0x05, 0x04}, 16)), "4.5.258");
  EXPECT_FALSE(read_version(bytes({1, 2, 3})));
  for (int status = 0; status < 256; ++status)
    EXPECT_EQ(*read_lock(bytes({status}, 28)), (status & 3) == 2) << status;
  EXPECT_FALSE(read_lock(bytes({2}, 27)));
  EXPECT_FALSE(read_byte({}));
}

TEST(Dlpc350Protocol, LevelsComeBackUnderBothPolaritiesAndMoreIsMoreLight) {
  for (const bool inverted : {false, true}) {
    for (int level = 0; level < 256; ++level) {
      const LedLevels levels{level, 255 - level, 17};
      const auto parameters = led_parameters(levels, inverted);
      ASSERT_TRUE(parameters);
      EXPECT_EQ(*read_led_levels(*parameters, inverted), levels);
    }
  }
  EXPECT_EQ((*led_parameters({0, 255, 100}, false))[0], std::byte{255});
  EXPECT_EQ((*led_parameters({0, 255, 100}, true))[0], std::byte{0});
  for (const int level : {-1, 256, 1000000})
    EXPECT_EQ(led_parameters({0, level, 0}, false).error().code, Errc::kInvalidOption);
  EXPECT_FALSE(read_led_levels(bytes({1, 2}), false));
}

TEST(Dlpc350Protocol, DegammaIsOneBitAndItsTableStays) {
  for (int gamma = 0; gamma < 256; ++gamma) {
    const auto byte = static_cast<std::uint8_t>(gamma);
    EXPECT_EQ(with_degamma(byte, false), gamma & 0x7F);
    EXPECT_EQ(with_degamma(byte, true), gamma | 0x80);
  }
}

TEST(Dlpc350Protocol, TheInputKeepsItsWidth) {
  EXPECT_EQ(*with_input(0x08, "test-pattern"), 0x09);
  EXPECT_EQ(*with_input(0x0B, "parallel"), 0x08);
  for (const char* name : {"parallel", "test-pattern", "flash", "fpd-link"})
    EXPECT_EQ(input_name(*with_input(0x10, name)), name);
  EXPECT_EQ(input_name(7), "unknown");
  const auto none = with_input(0, "hdmi");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kInvalidOption);
  EXPECT_THAT(none.error().what, HasSubstr("fpd-link"));
}

TEST(Dlpc350Protocol, TestPatternsAreNumberedFromSolidToStepBars) {
  EXPECT_EQ(*test_pattern("solid"), 0);
  EXPECT_EQ(*test_pattern("step-bars"), 10);
  EXPECT_FALSE(test_pattern("kitten"));
}

TEST(Dlpc350Protocol, StatusBitsAreApart) {
  EXPECT_TRUE(main_status(1).parked);
  EXPECT_TRUE(main_status(2).sequencer_runs);
  EXPECT_TRUE(main_status(4).frozen);
  EXPECT_TRUE(main_status(8).degamma);
  EXPECT_FALSE(main_status(0xF7).degamma);
  EXPECT_FALSE(main_status(0xFB).frozen);
  EXPECT_EQ(health_of(0x01, 0x01), Health::kOk);
  EXPECT_EQ(health_of(0x00, 0x01), Health::kError);
  EXPECT_EQ(health_of(0x01, 0x00), Health::kError);
  EXPECT_EQ(health_of(0x81, 0x01), Health::kError);
  EXPECT_EQ(health_of(0x05, 0x01), Health::kError);
  EXPECT_EQ(health_of(0x09, 0x01), Health::kWarning);
}

TEST(Dlpc350Protocol, WhatLightsTheLedsComesBackFromItsName) {
  for (int byte = 0; byte < 256; ++byte) {
    const std::string name = led_enable_name(static_cast<std::uint8_t>(byte));
    if ((byte & 0x0F) == 0) {
      EXPECT_EQ(name, "");
      continue;
    }
    const auto again = led_enable_byte(name);
    ASSERT_TRUE(again) << name;
    // The sequencer's bit leaves the others without a meaning, and so are bits 4 to 7.
    EXPECT_EQ(*again, (byte & 0x08) != 0 ? 0x08 : byte & 0x07) << name;
  }
  EXPECT_EQ(led_enable_name(0x05), "red blue");
  EXPECT_EQ(led_enable_byte("blue red"), std::uint8_t{0x05});
  for (const char* wrong :
       {"", " ", "red ", " red", "red  blue", "Red", "sequencer red", "white"}) {
    const auto byte = led_enable_byte(wrong);
    ASSERT_FALSE(byte) << wrong;
    EXPECT_EQ(byte.error().code, Errc::kInvalidOption);
  }
}

}  // namespace
}  // namespace veneer::projector::dlpc350
