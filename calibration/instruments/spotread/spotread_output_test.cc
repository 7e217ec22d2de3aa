// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/spotread/spotread_output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "base/files.h"

namespace veneer::calibration::spotread {
namespace {

using ::testing::HasSubstr;
using Kind = Event::Kind;

std::vector<Event> events_of(std::string_view text, std::size_t piece) {
  Output output;
  std::vector<Event> events;
  for (std::size_t at = 0; at < text.size(); at += piece) {
    output.feed(text.substr(at, piece));
    while (auto event = output.next()) events.push_back(*std::move(event));
  }
  return events;
}

std::vector<Kind> kinds_of(const std::vector<Event>& events) {
  std::vector<Kind> kinds;
  for (const Event& event : events) kinds.push_back(event.kind);
  return kinds;
}

// The prompts of ArgyllCMS 2.3.1.
const std::string kReady =
    "\nPlace instrument on spot to be measured,\n"
    "and hit [A-Z] to read white and setup FWA compensation (keyed to letter)\n"
    "[a-z] to read and make FWA compensated reading from keyed reference\n"
    "'r' to set reference, 's' to save spectrum,\n"
    "'h' to toggle high res., 'k' to do a calibration\n"
    "Hit ESC or Q to exit, any other key to take a reading: ";
const std::string kResult =
    "\n\n Result is XYZ: 211.830000 218.630000 232.520000, D50 Lab: 134.554789 1.052096 "
    "-22.943082\n";
const std::string kDark =
    "\nPlace cap on the instrument, or place on a dark surface,\n"
    "or place on the calibration reference,\n and then hit any key to continue,\n"
    " or hit Esc or Q to abort: ";
const std::string kMisread =
    "\nSpot read failed due to misread (Reading is inconsistent)\n"
    "Hit Esc or Q to give up, any other key to retry:";

TEST(SpotreadOutput, AConversationIsTheSameInPiecesOfAnySize) {
  const std::string text = kDark + "\nCalibration complete\n" + kReady + kResult + kReady +
                           kMisread + kReady + kResult + kReady;
  const std::vector<Kind> expected{Kind::kAction,
                                   Kind::kReady,
                                   Kind::kResult,
                                   Kind::kReady,
                                   Kind::kRetry,
                                   Kind::kReady,
                                   Kind::kResult,
                                   Kind::kReady};
  for (const std::size_t piece : std::vector<std::size_t>{1, 2, 3, 7, 64, 100000}) {
    const std::vector<Event> events = events_of(text, piece);
    ASSERT_EQ(kinds_of(events), expected) << piece;
    EXPECT_EQ(events[2].xyz, Xyz(211.83, 218.63, 232.52)) << piece;
    EXPECT_THAT(events[0].text, HasSubstr("Place cap on the instrument")) << piece;
    EXPECT_THAT(events[0].text, HasSubstr("or place on the calibration reference")) << piece;
    EXPECT_THAT(events[4].text, HasSubstr("Reading is inconsistent")) << piece;
  }
}

TEST(SpotreadOutput, ErrorsThatEndItAreFatal) {
  const auto events = events_of("spotread: Error - No instrument at port 1\n", 5);
  ASSERT_EQ(kinds_of(events), std::vector{Kind::kFatal});
  EXPECT_EQ(events[0].text, "spotread: Error - No instrument at port 1");
}

TEST(SpotreadOutput, AReadingThatHasBrokenOffIsNone) {
  for (const char* text : {"Result is XYZ: 1.0 2.0\n",
                           "Result is XYZ: 1.0 2.0 3.0\n",
                           "Result is XYZ: nan 1 2, D50\n",
                           "Result is XYZ: 1 inf 2, D50\n",
                           "Result is XYZ: , D50\n",
                           "Result is XYZ: 1.0.2 3 4, D50\n"}) {
    const auto events = events_of(text, 4);
    ASSERT_EQ(kinds_of(events), std::vector{Kind::kFatal}) << text;
    EXPECT_THAT(events[0].text, HasSubstr("no reading"));
  }
  EXPECT_TRUE(events_of(" Result is XYZ: 1.0 2.0 3.0, D5", 4).empty());  // not yet
}

TEST(SpotreadOutput, TheWrongPositionIsToldWithTheNextPrompt) {
  const auto events =
      events_of("\nSpot read failed due to the sensor being in the wrong position\n" + kReady, 11);
  ASSERT_EQ(kinds_of(events), std::vector{Kind::kReady});
  EXPECT_THAT(events[0].text, HasSubstr("wrong position"));
}

TEST(SpotreadOutput, TheCalibrationsOtherPromptsAreUnderstood) {
  EXPECT_EQ(kinds_of(events_of("Calibration failed with 'x' (y)\n"
                               "Hit any key to retry, or Esc or Q to abort:",
                               9)),
            std::vector{Kind::kRetry});
  EXPECT_EQ(kinds_of(events_of("Place the instrument on a 80% white test patch,\n"
                               " and then hit any key to continue,\n"
                               " or hit Esc or Q to abort, or S to skip: ",
                               9)),
            std::vector{Kind::kAction});
  EXPECT_EQ(kinds_of(events_of("There are saved spot readings in the instrument.\n"
                               "Hit ESC or Q to exit, N to not read saved reading,\n"
                               "any other key to use reading: ",
                               9)),
            std::vector{Kind::kSavedReading});
}

TEST(SpotreadOutput, GarbageIsKeptWithinBoundsAndPrintable) {
  Output output;
  for (int i = 0; i < 1000; ++i) {
    output.feed(std::string(1000, static_cast<char>(i)));
    output.feed(i % 3 == 0 ? "\n" : "");
    while (output.next()) {
    }
  }
  EXPECT_LT(output.complaint().size(), 10000U);
  for (const char c : output.complaint()) EXPECT_TRUE(c >= ' ' && c <= '~');
}

TEST(SpotreadOutput, ARealSessionHasItsTwoReadings) {
  const char* const data = std::getenv("VENEER_DATA");
  const std::filesystem::path path =
      std::filesystem::path(data != nullptr ? data : "../shared/data") / "colour/spotread-lcd.txt";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "real data absent: " << path;
  const auto text = read_text(path);
  ASSERT_TRUE(text);
  const auto events = events_of(*text, 100);
  EXPECT_EQ(kinds_of(events),
            (std::vector{Kind::kReady, Kind::kResult, Kind::kReady, Kind::kResult, Kind::kReady}));
  EXPECT_EQ(events[1].xyz, Xyz(211.83, 218.63, 232.52));
  EXPECT_EQ(events[3].xyz, Xyz(0, 0, 0));
}

}  // namespace
}  // namespace veneer::calibration::spotread
