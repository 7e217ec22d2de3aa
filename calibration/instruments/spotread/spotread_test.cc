// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/spotread/spotread.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <cerrno>
#include <filesystem>
#include <fstream>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

// A shell script stands in for the program, with its real prompts; times here are real, so that
// limits on them are loose.
namespace veneer::calibration {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

/// What the scripts share: the prompts, and a key as the program takes it, with a line's end.
constexpr const char* kPrelude = R"(#!/bin/sh
ready() {
  printf '\nPlace instrument on spot to be measured,\n'
  printf 'and hit [A-Z] to read white and setup FWA compensation (keyed to letter)\n'
  printf "'h' to toggle high res., 'k' to do a calibration\n"
  printf 'Hit ESC or Q to exit, any other key to take a reading: '
}
result() { printf '\n\n Result is XYZ: %s, D50 Lab: 1.0 2.0 3.0\n' "$1"; }
retry() { printf '\n%s\nHit Esc or Q to give up, any other key to retry:' "$1"; }
dark() {
  printf '\nPlace cap on the instrument, or place on a dark surface,\n'
  printf ' and then hit any key to continue,\n or hit Esc or Q to abort: '
}
key() { IFS= read -r pressed || exit 9; printf '%s\n' "$pressed" >> "$0.keys"; }
printf '%s\n' "$*" >> "$0.arguments"
printf '%s\n' "$ARGYLL_NOT_INTERACTIVE" >> "$0.environment"
)";

class SpotreadTest : public ::testing::Test {
 protected:
  /// Makes a program of this script the one that is started.
  void script(const std::string& body) {
    options_.program = folder_.path() / "spotread";
    std::ofstream(options_.program) << kPrelude << body;
    fs::permissions(options_.program, fs::perms::owner_all);
  }
  Result<std::unique_ptr<Spotread>> open() { return Spotread::open(options_, ask_, clock_); }
  std::unique_ptr<Spotread> opened() {
    auto instrument = open();
    EXPECT_TRUE(instrument) << instrument.error().what;
    return instrument ? *std::move(instrument) : nullptr;
  }
  static Result<Xyz> read(Spotread& instrument) {
    return instrument.read(Target::kWhiteReference, Eigen::Vector2d::Zero());
  }
  std::string written(const char* what) {
    return read_text(options_.program.string() + what).value_or("");
  }
  /// No child is left, neither running nor as a zombie.
  static testing::AssertionResult no_child_is_left() {
    const pid_t found = ::waitpid(-1, nullptr, WNOHANG);
    if (found < 0 && errno == ECHILD) return testing::AssertionSuccess();
    return testing::AssertionFailure() << "a child is left: " << found;
  }
  void TearDown() override { EXPECT_TRUE(no_child_is_left()); }

  TemporaryFolder folder_;
  SteadyClock clock_;
  SpotreadOptions options_;
  Spotread::Ask ask_;
};

TEST_F(SpotreadTest, EveryReadingIsOneKeyAndTheProgramStays) {
  script("ready; key; result '1.5 2.5 3.5'; ready; key; result '10.0 20.0 30.0'; ready; key\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  const auto process = instrument->process();
  const auto first = read(*instrument);
  const auto second = read(*instrument);
  ASSERT_TRUE(first) << first.error().what;
  ASSERT_TRUE(second) << second.error().what;
  EXPECT_EQ(*first, Xyz(1.5, 2.5, 3.5));
  EXPECT_EQ(*second, Xyz(10, 20, 30));
  EXPECT_EQ(instrument->process(), process);
  EXPECT_EQ(written(".keys"), " \n \n");
  EXPECT_EQ(written(".arguments"), "-e -yp\n");
  EXPECT_EQ(written(".environment"), "1\n");
}

TEST_F(SpotreadTest, OptionsBecomeArguments) {
  script("ready; key\n");
  options_.port = 2;
  options_.display_type = "l";
  options_.correction = "/x y/z.ccmx";
  ASSERT_TRUE(opened());
  EXPECT_EQ(written(".arguments"), "-e -yl -c 2 -X /x y/z.ccmx\n");
}

TEST_F(SpotreadTest, PromptsMayComeInPieces) {
  script(
      "printf 'Hit ESC or Q to exit, any oth'; sleep 0.1; printf 'er key to take a reading: '\n"
      "key; printf ' Result is XYZ: 1.0 2'; sleep 0.1; printf '.0 3.0, D50 Lab: 1 2 3\\n'; key\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_TRUE(xyz) << xyz.error().what;
  EXPECT_EQ(*xyz, Xyz(1, 2, 3));
}

TEST_F(SpotreadTest, APersonIsAskedToCalibrate) {
  std::string asked;
  ask_ = [&](const std::string& what) {
    asked = what;
    return Status{};
  };
  script("dark; key; printf 'Calibration complete\\n'; ready; key; result '1 2 3'; ready; key\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  EXPECT_THAT(asked, HasSubstr("Place cap on the instrument, or place on a dark surface"));
  EXPECT_TRUE(read(*instrument));
}

TEST_F(SpotreadTest, WhereNobodyCanBeAskedItFailsAndIsKilled) {
  script("dark; key; ready; key\n");
  const auto instrument = open();
  ASSERT_FALSE(instrument);
  EXPECT_EQ(instrument.error().code, Errc::kUnavailable);
  EXPECT_THAT(instrument.error().what, HasSubstr("Place cap"));
  EXPECT_TRUE(no_child_is_left());
}

TEST_F(SpotreadTest, WhoStopsItStopsIt) {
  ask_ = [](const std::string&) -> Status { return fail(Errc::kCancelled, "the person gave up"); };
  script("dark; key; ready; key\n");
  const auto instrument = open();
  ASSERT_FALSE(instrument);
  EXPECT_EQ(instrument.error().code, Errc::kCancelled);
}

TEST_F(SpotreadTest, AMisreadIsTriedAgainAndOnlySoOften) {
  script(
      "ready; key; retry 'Spot read failed due to misread (Reading is inconsistent)'; key\n"
      "ready; key; result '1 2 3'; ready; key\n"
      "while :; do retry 'Spot read failed due to misread (Reading is inconsistent)'; key; done\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  const auto good = read(*instrument);
  ASSERT_TRUE(good) << good.error().what;
  EXPECT_EQ(*good, Xyz(1, 2, 3));
  const auto bad = read(*instrument);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().code, Errc::kTimeout);
  EXPECT_THAT(bad.error().what, HasSubstr("Reading is inconsistent"));
  EXPECT_FALSE(instrument->process());
}

TEST_F(SpotreadTest, ALostInstrumentIsFinal) {
  script("ready; key; retry 'Spot read failed due to communication problem.'; key; sleep 60\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_FALSE(xyz);
  EXPECT_EQ(xyz.error().code, Errc::kDisconnected);
  EXPECT_THAT(xyz.error().what, HasSubstr("communication problem"));
}

TEST_F(SpotreadTest, TheWrongPositionIsAPersonsBusiness) {
  const std::string body =
      "ready; key; printf '\\nSpot read failed due to the sensor being in the wrong position\\n'\n"
      "ready; key; result '1 2 3'; ready; key\n";
  script(body);
  {
    const auto instrument = opened();
    ASSERT_TRUE(instrument);
    const auto xyz = read(*instrument);
    ASSERT_FALSE(xyz);
    EXPECT_EQ(xyz.error().code, Errc::kUnavailable);
    EXPECT_THAT(xyz.error().what, HasSubstr("wrong position"));
  }
  int asked = 0;
  ask_ = [&](const std::string&) {
    ++asked;
    return Status{};
  };
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_TRUE(xyz) << xyz.error().what;
  EXPECT_EQ(asked, 1);
}

TEST_F(SpotreadTest, SavedReadingsAreNotTaken) {
  script(
      "printf 'There are saved spot readings in the instrument.\\n'\n"
      "printf 'any other key to use reading: '; key\n"
      "ready; key; result '1 2 3'; ready; key\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  EXPECT_TRUE(read(*instrument));
  EXPECT_EQ(written(".keys"), "N\n \n");
}

TEST_F(SpotreadTest, OneThatHangsAtTheStartIsKilledWithAllThatItStarted) {
  options_.start_limit = milliseconds(500);
  script(
      "printf 'Connecting to the instrument ..\\n'\nsleep 300 &\necho $! > \"$0.child\"\nwait\n");
  const auto instrument = open();
  ASSERT_FALSE(instrument);
  EXPECT_EQ(instrument.error().code, Errc::kTimeout);
  EXPECT_THAT(instrument.error().what, HasSubstr("Connecting to the instrument"));
  // The grandchild is somebody else's to wait for; it may be gone or a zombie of his, not running.
  const std::string grandchild = written(".child");
  ASSERT_FALSE(grandchild.empty());
  const auto is_running = [&] {
    const std::string stat =
        read_text("/proc/" + grandchild.substr(0, grandchild.size() - 1) + "/stat").value_or("");
    return !stat.empty() && stat.find(") Z ") == std::string::npos;
  };
  const Time patience = clock_.now() + seconds(10);
  while (is_running() && clock_.now() < patience)
    clock_.sleep_until(clock_.now() + milliseconds(10));
  EXPECT_FALSE(is_running());
}

TEST_F(SpotreadTest, OneThatHangsInAReadingIsStartedAfresh) {
  options_.reading_limit = milliseconds(500);
  script(
      "ready; key\n"
      "if [ -e \"$0.second\" ]; then result '1 2 3'; ready; key; fi\n"
      "touch \"$0.second\"; trap '' TERM INT HUP; while :; do sleep 1; done\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  const auto hung = read(*instrument);
  ASSERT_FALSE(hung);
  EXPECT_EQ(hung.error().code, Errc::kTimeout);
  EXPECT_TRUE(no_child_is_left());
  const auto xyz = read(*instrument);
  ASSERT_TRUE(xyz) << xyz.error().what;
  EXPECT_EQ(*xyz, Xyz(1, 2, 3));
}

TEST_F(SpotreadTest, OneThatCrashesIsSaidSo) {
  script("ready; key; kill -SEGV $$\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_FALSE(xyz);
  EXPECT_EQ(xyz.error().code, Errc::kDisconnected);
  EXPECT_THAT(xyz.error().what, HasSubstr("signal 11"));
}

TEST_F(SpotreadTest, ErrorsAtTheStartArePassedOn) {
  script("printf 'spotread: Error - No instrument at port 1\\n'; exit 1\n");
  const auto none = open();
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kNotFound);
  EXPECT_THAT(none.error().what, HasSubstr("No instrument at port 1"));
  script("printf 'Instrument initialisation failed with %s\\n' 'Hardware Failure'; exit 3\n");
  const auto broken = open();
  ASSERT_FALSE(broken);
  EXPECT_THAT(broken.error().what, HasSubstr("Hardware Failure"));
  EXPECT_THAT(broken.error().what, HasSubstr("status 3"));
  script("exit 0\n");
  EXPECT_THAT(open().error().what, HasSubstr("said nothing"));
}

TEST_F(SpotreadTest, GarbageIsNeverAReading) {
  options_.reading_limit = seconds(3);
  script(
      "ready; key; head -c 200000 /dev/urandom; printf '\\n Result is XYZ: 1 nonsense\\n'; key\n");
  const auto instrument = opened();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_FALSE(xyz);
  for (const char c : xyz.error().what) EXPECT_TRUE(c >= ' ' && c <= '~');
}

TEST_F(SpotreadTest, AReadingNobodyAskedForIsNotTaken) {
  script("result '9 9 9'; ready; key\n");
  EXPECT_FALSE(open());
}

TEST_F(SpotreadTest, AProgramThatIsNotThereIsNamed) {
  options_.program = "/nonexistent/spotread";
  const auto instrument = open();
  ASSERT_FALSE(instrument);
  EXPECT_EQ(instrument.error().code, Errc::kNotFound);
  EXPECT_THAT(instrument.error().what, HasSubstr("/nonexistent/spotread"));
}

TEST_F(SpotreadTest, OptionsOutOfRangeAreRefused) {
  const auto refused = [](auto change) {
    SpotreadOptions options;
    change(options);
    const Status status = options.check();
    return !status && status.error().code == Errc::kInvalidOption;
  };
  EXPECT_TRUE(SpotreadOptions{}.check());
  EXPECT_TRUE(refused([](SpotreadOptions& o) { o.program.clear(); }));
  EXPECT_TRUE(refused([](SpotreadOptions& o) { o.port = -1; }));
  EXPECT_TRUE(refused([](SpotreadOptions& o) { o.display_type = "p; rm"; }));
  EXPECT_TRUE(refused([](SpotreadOptions& o) { o.start_limit = {}; }));
  EXPECT_TRUE(refused([](SpotreadOptions& o) { o.retries = 101; }));
}

// The real one, on a machine without an instrument: it says so, or hangs on a serial port that does
// not answer. Either way it ends, with a text, and leaves nothing behind.
TEST_F(SpotreadTest, TheRealProgramWithoutAnInstrumentFailsWithAText) {
  if (!fs::exists("/usr/bin/spotread")) GTEST_SKIP() << "ArgyllCMS is not installed";
  options_.start_limit = seconds(5);
  const auto instrument = open();
  if (instrument) GTEST_SKIP() << "there is an instrument";
  EXPECT_THAT(instrument.error().code,
              ::testing::AnyOf(Errc::kNotFound, Errc::kUnavailable, Errc::kTimeout))
      << instrument.error().what;
  EXPECT_THAT(instrument.error().what, HasSubstr("starting spotread"));
  if (instrument.error().code == Errc::kNotFound) {
    EXPECT_THAT(instrument.error().what, HasSubstr("nstrument"));
  }
  EXPECT_TRUE(no_child_is_left());
}

}  // namespace
}  // namespace veneer::calibration
