// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/pjlink_protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace veneer::projector::pjlink {
namespace {

using ::testing::HasSubstr;

const Request kPowerQuestion{1, "POWR", "?"};

TEST(PjlinkProtocol, RequestsAreALineEach) {
  EXPECT_EQ(line_of(kPowerQuestion), "%1POWR ?\r");
  EXPECT_EQ(line_of({1, "POWR", "1"}), "%1POWR 1\r");
  EXPECT_EQ(line_of({2, "INPT", "6A"}), "%2INPT 6A\r");
}

TEST(PjlinkProtocol, TheDigestIsMd5OfSeedAndPassword) {
  // RFC 1321, A.5: MD5 of "", "abc" and "message digest".
  EXPECT_EQ(digest("", ""), "d41d8cd98f00b204e9800998ecf8427e");
  EXPECT_EQ(digest("a", "bc"), "900150983cd24fb0d6963f7d28e17f72");
  EXPECT_EQ(digest("message ", "digest"), "f96b697d7cb7938d525a2f31aaf161d0");
}

TEST(PjlinkProtocol, ARefusedPasswordIsNoGreeting) {
  EXPECT_FALSE(read_greeting("PJLINK 0")->seed);
  EXPECT_EQ(read_greeting("PJLINK 1 498e4a67")->seed, "498e4a67");
  EXPECT_EQ(read_greeting("PJLINK ERRA").error().code, Errc::kInvalidOption);
  EXPECT_THAT(read_greeting("PJLINK ERRA").error().what, HasSubstr("password"));
  for (const char* line : {"",
                           "PJLINK",
                           "PJLINK 2",
                           "PJLINK 1",
                           "PJLINK 1 498e4a6",
                           "PJLINK 1 498e4a677",
                           "PJLINK 1 498e4a6g",
                           "pjlink 0",
                           "PJLINK 0 ",
                           "SSH-2.0-OpenSSH_9.2",
                           "\xff\xfe"}) {
    const auto greeting = read_greeting(line);
    ASSERT_FALSE(greeting) << line;
    EXPECT_EQ(greeting.error().code, Errc::kBadFormat) << line;
  }
}

TEST(PjlinkProtocol, ARefusalIsNotTakenForAValue) {
  EXPECT_EQ(read_reply("%1POWR=1", kPowerQuestion)->parameter, "1");
  EXPECT_EQ(read_reply("%1POWR=", kPowerQuestion)->parameter, "");
  const std::array codes{Errc::kUnavailable, Errc::kInvalidOption, Errc::kUnavailable, Errc::kIo};
  std::set<std::string> texts;
  for (int i = 1; i <= 4; ++i) {
    const auto reply = read_reply(fmt::format("%1POWR=ERR{}", i), kPowerQuestion);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->refusal, i);
    const Error error = error_of(*reply, kPowerQuestion);
    EXPECT_EQ(error.code, codes.at(static_cast<std::size_t>(i - 1)));
    EXPECT_THAT(error.what, HasSubstr("POWR ?"));
    texts.insert(error.what);
  }
  EXPECT_EQ(texts.size(), 4U);
  for (const char* line : {"%1POWR=ERR0", "%1POWR=ERR5", "%1POWR=ERR", "%1POWR=ERR11"})
    EXPECT_EQ(read_reply(line, kPowerQuestion)->refusal, 0) << line;
}

TEST(PjlinkProtocol, OnlyAReplyToTheRequestIsOne) {
  for (const char* line : {"PJLINK ERRA", "%1POWR=ERRA"})
    EXPECT_EQ(read_reply(line, kPowerQuestion).error().code, Errc::kInvalidOption) << line;
  for (const char* line :
       {"", "%1POWR", "%2POWR=1", "%1INPT=1", "1POWR=1", "POWR=1", "%1POWR 1", "PJLINK 0"})
    EXPECT_EQ(read_reply(line, kPowerQuestion).error().code, Errc::kBadFormat) << line;
}

TEST(PjlinkProtocol, PowerMuteAndFlagsHaveNoOtherValues) {
  EXPECT_EQ(*read_power("0"), Power::kOff);
  EXPECT_EQ(*read_power("1"), Power::kOn);
  EXPECT_EQ(*read_power("2"), Power::kCooling);
  EXPECT_EQ(*read_power("3"), Power::kWarmUp);
  for (const char* text : {"", "4", "-", "01", "1 "}) EXPECT_FALSE(read_power(text)) << text;
  for (const char* text : {"11", "31"}) EXPECT_TRUE(*read_mute(text)) << text;
  for (const char* text : {"10", "20", "21", "30"}) EXPECT_FALSE(*read_mute(text)) << text;
  for (const char* text : {"", "1", "01", "41", "12", "311"}) EXPECT_FALSE(read_mute(text)) << text;
  EXPECT_TRUE(*read_flag("1"));
  EXPECT_FALSE(*read_flag("0"));
  for (const char* text : {"", "2", "00"}) EXPECT_FALSE(read_flag(text)) << text;
}

TEST(PjlinkProtocol, TheErrorStatusHasSixDigitsInTheirOrder) {
  const auto health = read_health("012012");
  ASSERT_TRUE(health);
  EXPECT_EQ(health->at("fan"), Health::kOk);
  EXPECT_EQ(health->at("lamp"), Health::kWarning);
  EXPECT_EQ(health->at("temperature"), Health::kError);
  EXPECT_EQ(health->at("cover"), Health::kOk);
  EXPECT_EQ(health->at("filter"), Health::kWarning);
  EXPECT_EQ(health->at("other"), Health::kError);
  for (const char* text : {"", "00000", "0000000", "000003", "00000 "})
    EXPECT_FALSE(read_health(text)) << text;
}

TEST(PjlinkProtocol, LampsComeInPairsAndEightAtMost) {
  EXPECT_EQ(*read_lamps("1234 1"), (std::vector<Lamp>{{1234, true}}));
  EXPECT_EQ(*read_lamps("0 0 99999 1"), (std::vector<Lamp>{{0, false}, {99999, true}}));
  std::string eight = "1 0";
  for (int i = 1; i < 8; ++i) eight += " 1 0";
  EXPECT_EQ(read_lamps(eight)->size(), 8U);
  EXPECT_FALSE(read_lamps(eight + " 1 0"));
  for (const char* text :
       {"", " ", "1", "1 ", "1 2", "x 1", "-1 1", "1 1 ", "1 1 2", "1 11", "1  1", "9999999 1"})
    EXPECT_FALSE(read_lamps(text)) << text;
}

TEST(PjlinkProtocol, NamesOfInputsAndTheirCodesAreOne) {
  for (char kind = '1'; kind <= '6'; ++kind) {
    for (const char number : std::string("123456789AMZ")) {
      const std::string code{kind, number};
      const auto name = input_name(code);
      ASSERT_TRUE(name) << code;
      EXPECT_EQ(*input_code(*name), code);
      EXPECT_EQ(*input_code(code), code);
    }
  }
  EXPECT_EQ(*input_name("31"), "digital1");
  for (const char* code : {"", "3", "01", "71", "30", "3a", "311"})
    EXPECT_EQ(input_name(code).error().code, Errc::kBadFormat) << code;
  for (const char* name : {"", "hdmi", "digital", "digital0", "digital12", "Digital1"})
    EXPECT_EQ(input_code(name).error().code, Errc::kInvalidOption) << name;
}

TEST(PjlinkProtocol, AResolutionIsTwoNumbersAndNothingElse) {
  EXPECT_EQ(read_resolution("1920x1080"), (Resolution{1920, 1080}));
  EXPECT_EQ(read_resolution("1x99999"), (Resolution{1, 99999}));
  for (const char* text : {"",
                           "-",
                           "*",
                           "x",
                           "1920x",
                           "x1080",
                           "0x1080",
                           "1920x0",
                           "1920X1080",
                           "1920x1080x2",
                           "1920 x 1080",
                           "-1x5",
                           "+1x5",
                           "1920x1080p",
                           "100000x1"})
    EXPECT_FALSE(read_resolution(text)) << text;
}

TEST(PjlinkProtocol, TextsForPeopleAreUtf8) {
  EXPECT_EQ(readable("Hall 3"), "Hall 3");
  EXPECT_EQ(readable("S\xc3\xa4"
                     "le"),
            "S\xc3\xa4"
            "le");
  EXPECT_EQ(readable("a\x01\x1b[31m"), "a??[31m");
  EXPECT_EQ(readable("\xff\xc3"), "??");
  EXPECT_EQ(readable("\xed\xa0\x80"), "???");  // a surrogate
  EXPECT_EQ(readable("\xc0\xaf"), "??");       // an overlong form
}

}  // namespace
}  // namespace veneer::projector::pjlink
