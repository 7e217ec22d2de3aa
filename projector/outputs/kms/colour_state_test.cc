// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/colour_state.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <new>
#include <thread>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "projector/outputs/kms/fake_kms_device.h"
#include "projector/outputs/kms/kms_output.h"

namespace veneer::projector {
namespace {

constexpr int kWidth = 8;
constexpr int kHeight = 6;

/// Tables as a colour-managed desktop leaves them.
FakeColours some_colours(std::uint64_t seed) {
  Pcg32 random(seed);
  FakeColours colours;
  const auto fill = [&random](FakeColours::Table& table, std::size_t size) {
    table.size = size;
    for (std::size_t i = 0; i < size; ++i) table.bytes[i] = static_cast<char>(random.next());
  };
  fill(colours.gamma, 2048);
  fill(colours.degamma, seed % 2 == 0 ? 0 : 512);  // sometimes there is none
  fill(colours.matrix, 72);
  fill(colours.hdr, seed % 3 == 0 ? 0 : 32);
  colours.broadcast = 2;
  colours.max_bits = 10;
  colours.colorspace = 9;
  colours.dither = 1;
  colours.dithering_mode = 3;
  colours.underscan = 2;
  for (std::uint16_t& value : colours.ramp) value = static_cast<std::uint16_t>(random.next());
  return colours;
}

FakeColours neutral_colours(const FakeColours& before, bool tables) {
  FakeColours colours = before;
  colours.broadcast = 1;
  colours.max_bits = 8;
  colours.hdr = {};
  colours.colorspace = 0;
  colours.dither = 0;
  colours.dithering_mode = 1;
  colours.underscan = 0;
  if (tables) {
    colours.gamma = colours.degamma = colours.matrix = {};
  } else {
    for (std::size_t i = 0; i < colours.ramp.size(); ++i)
      colours.ramp[i] = static_cast<std::uint16_t>(257 * (i % 256));
  }
  return colours;
}

class ColourStateTest : public testing::Test {
 protected:
  ColourStateTest() {
    // Shared with processes that are killed.
    void* memory = ::mmap(
        nullptr, sizeof(FakeHardware), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    VENEER_CHECK(memory != MAP_FAILED);
    hardware_ = new (memory) FakeHardware;
    card_.hardware = hardware_;
    card_.connectors = {
        {"HDMI-A-1", fake_edid("EPSON PJ", "A1"), true, {fake_mode(kWidth, kHeight, 60, true)}}};
    options_.buffers = KmsOutputOptions::Buffers::kMapped;
    options_.state_directory = folder_.path() / "state";
  }
  ~ColourStateTest() override { ::munmap(hardware_, sizeof(FakeHardware)); }

  Result<std::unique_ptr<KmsOutput>> open() {
    return KmsOutput::open(options_, std::make_unique<FakeKmsDevice>(card_, clock_), clock_);
  }
  /// A whole run: open, a few frames, close.
  [[nodiscard]] bool run() {
    auto output = open();
    if (!output) return false;
    const Image<Rgb16> picture(kWidth, kHeight, Rgb16{1, 2, 3});
    Frame frame;
    frame.codes = picture.view();
    for (int i = 0; i < 3; ++i) {
      if (!(*output)->present(frame)) return false;
    }
    return true;
  }
  [[nodiscard]] std::filesystem::path file() const {
    return options_.state_directory / "kms-card7-HDMI-A-1.json";
  }
  /// What a killed run leaves: neutral colours and the file.
  void leave_behind(const FakeColours& found) {
    hardware_->set(found);
    auto output = open();
    ASSERT_TRUE(output) << output.error().what;
    const auto text = read_text(file());
    ASSERT_TRUE(text) << text.error().what;
    const FakeColours changed = hardware_->colours();
    output->reset();
    ASSERT_TRUE(write_text(file(), *text));
    hardware_->set(changed);
  }

  TemporaryFolder folder_;
  FakeHardware* hardware_ = nullptr;
  FakeCard card_;
  VirtualClock clock_{Time(std::chrono::seconds(5))};
  KmsOutputOptions options_;
};

TEST_F(ColourStateTest, TextGivesBackWhatItWasMadeOf) {
  for (std::uint64_t seed = 1; seed < 5; ++seed) {
    hardware_->set(some_colours(seed));
    card_.tables = seed != 4;
    FakeKmsDevice device(card_, clock_);
    const auto connector = device.connector(FakeKmsDevice::connector_id(0), true);
    const auto state = read_colour_state(device, *connector, FakeKmsDevice::crtc_id(0));
    ASSERT_TRUE(state) << state.error().what;
    EXPECT_EQ(state->ramp.empty(), card_.tables);
    const auto back = parse_colour_state(text_of(*state));
    ASSERT_TRUE(back) << back.error().what;
    EXPECT_EQ(text_of(*back), text_of(*state));
  }
}

TEST_F(ColourStateTest, TablesAreNeutralWhileOpenAndBackAfterwards) {
  for (const bool tables : {true, false}) {
    card_.tables = tables;
    const FakeColours found = some_colours(1);
    hardware_->set(found);
    {
      auto output = open();
      ASSERT_TRUE(output) << output.error().what;
      EXPECT_TRUE(hardware_->colours() == neutral_colours(found, tables));
      EXPECT_TRUE(std::filesystem::exists(file()));
    }
    EXPECT_TRUE(hardware_->colours() == found) << tables;
    EXPECT_FALSE(std::filesystem::exists(file()));
  }
}

TEST_F(ColourStateTest, WhatIsFoundIsOnTheDiskBeforeTheFirstChange) {
  const FakeColours found = some_colours(3);
  hardware_->set(found);
  int changes = 0;
  card_.before_colour_change = [&] {
    ++changes;
    const auto text = read_text(file());
    ASSERT_TRUE(text) << "a change with nothing saved";
    EXPECT_TRUE(parse_colour_state(*text));
  };
  ASSERT_TRUE(run());
  EXPECT_GE(changes, 2);  // away and back
}

TEST_F(ColourStateTest, WithoutAFolderTheyAreKeptInMemory) {
  options_.state_directory.clear();
  const FakeColours found = some_colours(1);
  hardware_->set(found);
  ASSERT_TRUE(run());
  EXPECT_TRUE(hardware_->colours() == found);
}

TEST_F(ColourStateTest, AFolderThatCannotBeWrittenStopsTheStartBeforeAnyChange) {
  options_.state_directory = "/proc/nowhere";
  const FakeColours found = some_colours(1);
  hardware_->set(found);
  const auto output = open();
  ASSERT_FALSE(output);
  EXPECT_EQ(output.error().code, Errc::kIo);
  EXPECT_TRUE(hardware_->colours() == found);
}

TEST_F(ColourStateTest, TheNextStartBringsBackWhatAKilledOneLeft) {
  const FakeColours found = some_colours(1);
  leave_behind(found);
  ASSERT_FALSE(hardware_->colours() == found);
  ASSERT_TRUE(run());
  EXPECT_TRUE(hardware_->colours() == found);
  EXPECT_FALSE(std::filesystem::exists(file()));
}

TEST_F(ColourStateTest, ASocketThatIsNoLongerChosenGetsItsTablesBackToo) {
  const FakeColours found = some_colours(1);
  leave_behind(found);
  card_.connectors.push_back({"DP-1", "", true, {fake_mode(kWidth, kHeight, 60)}});
  options_.connector = "DP-1";
  ASSERT_TRUE(run());
  EXPECT_TRUE(hardware_->colours() == found);
}

TEST_F(ColourStateTest, WhatCannotBeBroughtBackNowIsKeptForLater) {
  const FakeColours found = some_colours(1);
  leave_behind(found);
  const auto saved = read_text(file());
  int commits = 0;
  card_.refuse = [&commits](KmsCommit how) {
    return how == KmsCommit::kFull && commits++ == 0 ? EINVAL : 0;
  };
  {
    auto output = open();
    ASSERT_TRUE(output) << output.error().what;
    EXPECT_EQ(read_text(file()).value_or(""), *saved);  // the older truth
  }
  EXPECT_TRUE(hardware_->colours() == found);
}

TEST_F(ColourStateTest, AnotherProgramsCardKeepsTheFileForTheNextStart) {
  const FakeColours found = some_colours(1);
  hardware_->set(found);
  {
    auto output = open();
    ASSERT_TRUE(output);
    card_.other_master = true;
  }
  EXPECT_TRUE(std::filesystem::exists(file()));
  card_.other_master = false;
  ASSERT_TRUE(run());
  EXPECT_TRUE(hardware_->colours() == found);
}

TEST_F(ColourStateTest, AfterANewStartOfTheMachineNothingIsBroughtBack) {
  leave_behind(some_colours(1));
  auto state = parse_colour_state(*read_text(file()));
  ASSERT_TRUE(state);
  state->boot = "an earlier one";
  ASSERT_TRUE(write_text(file(), text_of(*state)));
  const FakeColours fresh = some_colours(2);
  hardware_->set(fresh);
  ASSERT_TRUE(run());
  EXPECT_TRUE(hardware_->colours() == fresh);
  EXPECT_FALSE(std::filesystem::exists(file()));
}

TEST_F(ColourStateTest, ADamagedFileIsAppliedInNoPartAndMovedAside) {
  leave_behind(some_colours(1));
  const std::string whole = *read_text(file());
  const FakeColours now = hardware_->colours();
  Pcg32 random(7);
  for (int i = 0; i < 60; ++i) {
    std::string text = whole;
    if (i % 2 == 0) {
      text.resize(random.next() % (whole.size() - 1));
    } else {
      text[random.next() % (whole.size() - 1)] ^= static_cast<char>(1 + random.next() % 255);
    }
    const auto parsed = parse_colour_state(text);
    ASSERT_FALSE(parsed) << i << ": " << text.substr(0, 200);
    EXPECT_EQ(parsed.error().code, Errc::kBadFormat);
    ASSERT_TRUE(write_text(file(), text));
    ASSERT_TRUE(run()) << "it must not keep the show from going on";
    EXPECT_TRUE(hardware_->colours() == now);
    std::filesystem::path aside = file();
    aside += ".damaged";
    EXPECT_EQ(read_text(aside).value_or(""), text);
    EXPECT_FALSE(std::filesystem::exists(file()));
  }
}

TEST_F(ColourStateTest, ALaterVersionIsNotGuessedAt) {
  leave_behind(some_colours(1));
  const auto state = parse_colour_state(*read_text(file()));
  ASSERT_TRUE(state);
  for (const char* text : {"", "{}", "[]", "null", "{\"checksum\":1,\"state\":2}", "\xff"})
    EXPECT_EQ(parse_colour_state(text).error().code, Errc::kBadFormat) << text;
}

TEST(NeutralRamp, IsAStraightLineFromNothingToFull) {
  for (const std::size_t size : {2U, 3U, 256U, 1024U, 4096U}) {
    const auto ramp = neutral_ramp(3 * size);
    ASSERT_EQ(ramp.size(), 3 * size);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(ramp[c * size], 0);
      EXPECT_EQ(ramp[c * size + size - 1], 65535);
      for (std::size_t i = 0; i < size; ++i)
        EXPECT_NEAR(ramp[c * size + i], 65535.0 * i / (size - 1), 0.5);
    }
  }
  EXPECT_TRUE(neutral_ramp(0).empty());
  EXPECT_EQ(neutral_ramp(3).size(), 3U);
}

class KilledTest : public ColourStateTest {
 protected:
  /// Runs in a process of its own. @return whether it was killed before its end.
  bool run_in_child(const std::function<void()>& arm) {
    const pid_t child = ::fork();
    if (child == 0) {
      arm();
      ::_exit(run() ? 0 : 1);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
    return WIFSIGNALED(status);
  }
};

TEST_F(KilledTest, BeforeAnyCallToTheCardTheTablesComeBackWithTheNextStart) {
  for (const bool tables : {true, false}) {
    card_.tables = tables;
    bool killed = true;
    int moments = 0;
    for (; killed && moments < 2000; ++moments) {
      const FakeColours found = some_colours(static_cast<std::uint64_t>(moments));
      hardware_->set(found);
      killed = run_in_child([this, moments] {
        card_.before_call = [left = moments]() mutable {
          if (left-- == 0) ::kill(::getpid(), SIGKILL);
        };
      });
      ASSERT_TRUE(run()) << moments;
      ASSERT_TRUE(hardware_->colours() == found) << "killed before call " << moments;
    }
    EXPECT_FALSE(killed);
    EXPECT_GT(moments, 50);  // there was something to kill
    RecordProperty(tables ? "moments_tables" : "moments_ramp", moments);
  }
}

TEST_F(KilledTest, BetweenTwoKilledStartsNothingIsLostEither) {
  for (int moment = 0; moment < 120; moment += 7) {
    const FakeColours found = some_colours(static_cast<std::uint64_t>(moment));
    hardware_->set(found);
    for (int second = 3; second < 120; second += 31) {
      run_in_child([this, moment, second] {
        card_.before_call = [left = moment + second]() mutable {
          if (left-- == 0) ::kill(::getpid(), SIGKILL);
        };
      });
    }
    ASSERT_TRUE(run());
    ASSERT_TRUE(hardware_->colours() == found) << moment;
  }
}

TEST_F(KilledTest, AtAnyOtherMomentToo) {
  Pcg32 random(11);
  int killed = 0;
  for (int i = 0; i < 150; ++i) {
    const FakeColours found = some_colours(random.next());
    hardware_->set(found);
    const pid_t child = ::fork();
    if (child == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that crashed
      while (run()) {
      }
      ::_exit(1);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(random.next() % 6000));
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    killed += WIFSIGNALED(status) ? 1 : 0;
    ASSERT_TRUE(run());
    ASSERT_TRUE(hardware_->colours() == found) << "run " << i;
  }
  EXPECT_EQ(killed, 150);
}

}  // namespace
}  // namespace veneer::projector
