// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "projector/control/dlpc350/dlpc350.h"
#include "projector/control_watch.h"
#include "projector/controls.h"
#include "tracking/testing/mock_hidraw.h"

// A DLPC350 on a mocked bus, under the real hidapi. It stands here because the mocked bus is of the
// same floor as projector/. Times here are real, so that limits on them are loose.
namespace veneer::projector {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using tracking::mock::Bytes;
using tracking::mock::HidrawDevice;

Bytes bytes(std::initializer_list<int> values, std::size_t size) {
  Bytes result(size);
  std::size_t at = 0;
  for (const int value : values) result.at(at++) = static_cast<std::byte>(value);
  return result;
}

/// What hidapi is to have written: the report's number, 0, and 64 bytes.
Bytes written(std::initializer_list<int> values) {
  Bytes result = bytes(values, 64);
  result.insert(result.begin(), std::byte{0});
  return result;
}

enum class Fault {
  kNone,
  kNack,
  kNackRead,
  kNackWrite,
  kSilence,
  kStrayFirst,
  kChatter,
  kBrokenLength,
  kShort,
  kUnplug
};

/// Holds values by command, and answers as the layout says.
class Dlpc350Bus : public ::testing::Test {
 protected:
  Dlpc350Bus()
      : device_({0x0451, 0x6401, "DLPC350", "LCR3", "2-1", 0}),
        other_interface_({0x0451, 0x6401, "DLPC350", "LCR3", "2-1", 1}) {
    values_ = {{0x0200, {0}},
               {0x0205, {0, 0, 4, 4, 1, 0, 1, 4, 0, 0, 0, 0, 0, 0, 0, 0}},
               {0x071C, std::vector<int>(28, 0)},
               {0x0B01, {155, 135, 165}},
               {0x1A00, {0x08}},
               {0x1A05, {0}},
               {0x1A07, {0x08}},
               {0x1A0A, {1}},
               {0x1A0B, {1}},
               {0x1A0C, {0x0A}},
               {0x1A0E, {0x81}},
               {0x1A1B, {0}}};
    values_[0x071C][0] = 2;
    device_.on_output([this](const Bytes& report) { answer(report); });
    other_interface_.on_output([this](const Bytes&) { ++strangers_; });
  }

  void answer(const Bytes& report) {
    std::vector<Bytes> replies;
    bool unplug = false;
    {
      const std::lock_guard lock(mutex_);
      received_.push_back(report);
      const auto at = [&](std::size_t i) { return std::to_integer<int>(report.at(i)); };
      const int flags = at(1);
      const int sequence = at(2);
      const int command = at(5) + 256 * at(6);
      const bool is_read = (flags & 0x80) != 0;
      const Fault fault = faults_.contains(command) ? faults_[command] : Fault::kNone;
      const bool refused =
          fault == Fault::kNack || fault == (is_read ? Fault::kNackRead : Fault::kNackWrite);
      if (fault == Fault::kSilence) return;
      if (fault == Fault::kUnplug) unplug = true;
      if (!is_read && (fault == Fault::kNone || fault == Fault::kNackRead)) {
        const int size = at(3) - 2;
        for (int i = 0; i < size; ++i) {
          auto& value = values_[command];
          value.resize(static_cast<std::size_t>(size));
          value[static_cast<std::size_t>(i)] = at(static_cast<std::size_t>(7 + i));
        }
      }
      const int reply_flags = is_read ? 0xC0 : 0x40;
      if (fault == Fault::kStrayFirst)
        replies.push_back(bytes({reply_flags, (sequence + 255) % 256, 1, 0, 0x77}, 64));
      if (fault == Fault::kChatter)
        for (int i = 0; i < 100; ++i)
          replies.push_back(bytes({reply_flags, (sequence + 100) % 256, 1, 0, 0x77}, 64));
      Bytes reply = bytes({reply_flags, sequence}, 64);
      if (refused || (is_read && !values_.contains(command))) {
        reply[0] |= std::byte{0x20};
      } else if (is_read) {
        const std::vector<int>& value = values_[command];
        reply[2] = static_cast<std::byte>(value.size());
        for (std::size_t i = 0; i < value.size(); ++i)
          reply.at(4 + i) = static_cast<std::byte>(value[i]);
      }
      if (fault == Fault::kBrokenLength) reply[3] = std::byte{0xFF};
      if (fault == Fault::kShort) reply[2] = std::byte{0};
      if (fault != Fault::kChatter) replies.push_back(reply);
    }
    if (unplug) return device_.fail_read(EIO);
    for (const Bytes& reply : replies) device_.send(reply);
  }

  std::unique_ptr<Dlpc350> open() {
    auto opened = Dlpc350::open(options_, clock_);
    EXPECT_TRUE(opened) << opened.error().what;
    return opened ? *std::move(opened) : nullptr;
  }
  std::vector<Bytes> take_received() {
    const std::lock_guard lock(mutex_);
    return std::exchange(received_, {});
  }
  std::vector<int> value(int command) {
    const std::lock_guard lock(mutex_);
    return values_[command];
  }
  std::map<int, std::vector<int>> all_values() {
    const std::lock_guard lock(mutex_);
    return values_;
  }
  void set(int command, std::vector<int> value) {
    const std::lock_guard lock(mutex_);
    values_[command] = std::move(value);
  }
  void fault(int command, Fault fault) {
    const std::lock_guard lock(mutex_);
    faults_[command] = fault;
  }

  SteadyClock clock_;
  Dlpc350Options options_;
  std::mutex mutex_;
  std::map<int, std::vector<int>> values_;
  std::map<int, Fault> faults_;
  std::vector<Bytes> received_;
  std::atomic<int> strangers_{0};
  HidrawDevice device_;
  HidrawDevice other_interface_;
};

TEST_F(Dlpc350Bus, EveryByteOfACommandIsAsLaidDown) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  EXPECT_THAT(engine->description(), HasSubstr("LCR3"));
  EXPECT_TRUE(engine->power(true));
  EXPECT_TRUE(engine->freeze(true));
  EXPECT_TRUE(engine->set_processing(false));
  EXPECT_TRUE(engine->set_degamma(false));
  EXPECT_TRUE(engine->set_led_levels({100, 120, 90}));
  EXPECT_EQ(take_received(),
            (std::vector<Bytes>{written({0x40, 0, 3, 0, 0x00, 0x02, 0}),
                                written({0x40, 1, 3, 0, 0x0A, 0x10, 1}),
                                written({0x40, 2, 3, 0, 0x1B, 0x1A, 1}),
                                written({0xC0, 3, 2, 0, 0x0E, 0x1A}),
                                written({0x40, 4, 3, 0, 0x0E, 0x1A, 0x01}),
                                written({0xC0, 5, 2, 0, 0x05, 0x1A}),
                                written({0x40, 6, 5, 0, 0x01, 0x0B, 155, 135, 165})}));
}

TEST_F(Dlpc350Bus, EveryByteOfWhatIsReadFirstAndThenChangedIsAsLaidDown) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  EXPECT_TRUE(engine->power(false));
  EXPECT_TRUE(engine->mute(true));
  EXPECT_TRUE(engine->mute(false));
  EXPECT_TRUE(engine->select_input("flash"));
  EXPECT_TRUE(engine->show_test_pattern("step-bars"));
  EXPECT_TRUE(engine->set_processing(true));
  EXPECT_EQ(take_received(),
            (std::vector<Bytes>{written({0x40, 0, 3, 0, 0x00, 0x02, 1}),
                                written({0xC0, 1, 2, 0, 0x07, 0x1A}),
                                written({0x40, 2, 3, 0, 0x07, 0x1A, 0}),
                                written({0xC0, 3, 2, 0, 0x07, 0x1A}),
                                written({0x40, 4, 3, 0, 0x07, 0x1A, 0x08}),
                                written({0xC0, 5, 2, 0, 0x00, 0x1A}),
                                written({0x40, 6, 3, 0, 0x00, 0x1A, 0x0A}),
                                written({0xC0, 7, 2, 0, 0x00, 0x1A}),
                                written({0x40, 8, 3, 0, 0x00, 0x1A, 0x09}),
                                written({0x40, 9, 3, 0, 0x03, 0x12, 0x0A}),
                                written({0x40, 10, 3, 0, 0x1B, 0x1A, 0})}));
}

TEST_F(Dlpc350Bus, ItsWholeStateIsRead) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  const auto state = engine->read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->power, Power::kOn);
  EXPECT_EQ(state->firmware, "4.4.0");
  EXPECT_EQ(state->serial, "LCR3");
  EXPECT_EQ(state->input, "parallel");
  EXPECT_EQ(state->muted, false);
  EXPECT_EQ(state->frozen, false);
  EXPECT_EQ(state->degamma, true);
  EXPECT_EQ(state->processing, true);
  EXPECT_EQ(state->locked, true);
  EXPECT_EQ(state->led_levels, (LedLevels{100, 120, 90}));
  EXPECT_EQ(state->health.at("other"), Health::kOk);
  set(0x1A05, {1});  // the other polarity: the same bytes are other levels
  EXPECT_EQ(engine->read_state()->led_levels, (LedLevels{155, 135, 165}));
}

TEST_F(Dlpc350Bus, TheWrongInterfaceIsNotTaken) {
  other_interface_.plug();
  const auto none = Dlpc350::open(options_, clock_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kNotFound);
  EXPECT_TRUE(connected_light_engines().empty());
  device_.plug();
  ASSERT_EQ(connected_light_engines().size(), 1U);
  EXPECT_EQ(connected_light_engines().front().node, device_.node());
  const auto engine = open();
  ASSERT_TRUE(engine);
  EXPECT_TRUE(engine->freeze(false));
  EXPECT_EQ(strangers_, 0);
  EXPECT_EQ(other_interface_.openings(), 0U);
}

TEST_F(Dlpc350Bus, OtherDevicesAreLeftAlone) {
  HidrawDevice other({0x0451, 0x6402, "Another", "X", "2-2", 0});
  other.plug();
  EXPECT_EQ(Dlpc350::open(options_, clock_).error().code, Errc::kNotFound);
  EXPECT_EQ(other.openings(), 0U);
}

TEST_F(Dlpc350Bus, OfTwoTheSerialNumberDecides) {
  HidrawDevice second({0x0451, 0x6401, "DLPC350", "LCR4", "2-2", 0});
  device_.plug();
  second.plug();
  const auto either = Dlpc350::open(options_, clock_);
  ASSERT_FALSE(either);
  EXPECT_EQ(either.error().code, Errc::kInvalidOption);
  EXPECT_THAT(either.error().what, HasSubstr("LCR4"));
  options_.serial = "LCR3";
  const auto engine = open();
  ASSERT_TRUE(engine);
  EXPECT_TRUE(engine->freeze(true));
  options_.serial = "LCR5";
  const auto none = Dlpc350::open(options_, clock_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kNotFound);
}

TEST_F(Dlpc350Bus, ARefusalIsSaidOfACommandAndLeavesAStateEmpty) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  fault(0x100A, Fault::kNack);
  const Status done = engine->freeze(true);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::kUnavailable);
  EXPECT_THAT(done.error().what, HasSubstr("NACK"));
  const std::map<int, std::function<bool(const ProjectorState&)>> empty{
      {0x0200, [](const auto& s) { return s.power == Power::kUnknown; }},
      {0x0205, [](const auto& s) { return !s.firmware; }},
      {0x071C, [](const auto& s) { return !s.locked; }},
      {0x0B01, [](const auto& s) { return !s.led_levels; }},
      {0x1A00, [](const auto& s) { return !s.input; }},
      {0x1A05, [](const auto& s) { return !s.led_levels; }},
      {0x1A07, [](const auto& s) { return !s.muted && !s.led_enable; }},
      {0x1A0A, [](const auto& s) { return s.health.empty(); }},
      {0x1A0C, [](const auto& s) { return !s.frozen && !s.degamma; }},
      {0x1A1B, [](const auto& s) { return !s.processing; }}};
  for (const auto& [command, is_empty] : empty) {
    fault(command, Fault::kNack);
    const auto state = engine->read_state();
    ASSERT_TRUE(state) << state.error().what;
    EXPECT_TRUE(is_empty(*state)) << command;
    fault(command, Fault::kNone);
  }
}

TEST_F(Dlpc350Bus, EveryRefusalOfEveryCommandIsToldAndChangesNothing) {
  struct Refusal {
    const char* named;
    int command;
    Fault fault;
    std::function<Status(Dlpc350&)> act;
  };
  const auto mute = [](Dlpc350& e) { return e.mute(true); };
  const auto input = [](Dlpc350& e) { return e.select_input("flash"); };
  const auto degamma = [](Dlpc350& e) { return e.set_degamma(false); };
  const auto levels = [](Dlpc350& e) { return e.set_led_levels({1, 2, 3}); };
  const auto pattern = [](Dlpc350& e) { return e.show_test_pattern("grid"); };
  const std::vector<Refusal> refusals{
      {"0x0200", 0x0200, Fault::kNackWrite, [](Dlpc350& e) { return e.power(false); }},
      {"0x0b01", 0x0B01, Fault::kNackWrite, levels},
      {"0x100a", 0x100A, Fault::kNackWrite, [](Dlpc350& e) { return e.freeze(true); }},
      {"0x1203", 0x1203, Fault::kNackWrite, pattern},
      {"0x1a00", 0x1A00, Fault::kNackRead, input},
      {"0x1a00", 0x1A00, Fault::kNackWrite, input},
      {"0x1a00", 0x1A00, Fault::kNackRead, pattern},
      {"0x1a00", 0x1A00, Fault::kNackWrite, pattern},
      {"0x1a05", 0x1A05, Fault::kNackRead, levels},
      {"0x1a07", 0x1A07, Fault::kNackRead, mute},
      {"0x1a07", 0x1A07, Fault::kNackWrite, mute},
      {"0x1a0e", 0x1A0E, Fault::kNackRead, degamma},
      {"0x1a0e", 0x1A0E, Fault::kNackWrite, degamma},
      {"0x1a1b", 0x1A1B, Fault::kNackWrite, [](Dlpc350& e) { return e.set_processing(false); }}};
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  const auto values = all_values();
  for (const Refusal& each : refusals) {
    fault(each.command, each.fault);
    const Status done = each.act(*engine);
    ASSERT_FALSE(done) << each.named;
    EXPECT_EQ(done.error().code, Errc::kUnavailable) << each.named;
    EXPECT_THAT(done.error().what, HasSubstr(each.named));
    EXPECT_EQ(all_values(), values) << each.named;
    // No later command pays for it.
    fault(each.command, Fault::kNone);
    const Status again = each.act(*engine);
    EXPECT_TRUE(again) << each.named << again.error().what;
    EXPECT_NE(all_values(), values) << each.named;
    const std::lock_guard lock(mutex_);
    values_ = values;
  }
}

TEST_F(Dlpc350Bus, RepliesToOtherRequestsArePassedOver) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  fault(0x1A00, Fault::kStrayFirst);
  const auto state = engine->read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->input, "parallel");
  EXPECT_EQ(state->led_levels, (LedLevels{100, 120, 90}));
}

TEST_F(Dlpc350Bus, SilenceAndChatterEndInTimeAndTheNextCommandWorks) {
  options_.time_limit = 200ms;
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  for (const Fault each : {Fault::kSilence, Fault::kChatter}) {
    fault(0x100A, each);
    const Time start = clock_.now();
    const Status done = engine->freeze(true);
    EXPECT_LT(clock_.now() - start, 2s);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, Errc::kTimeout);
    fault(0x100A, Fault::kNone);
    EXPECT_TRUE(engine->freeze(true));
  }
}

TEST_F(Dlpc350Bus, BrokenRepliesAreRefused) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  for (const Fault each : {Fault::kBrokenLength, Fault::kShort}) {
    fault(0x1A00, each);
    const auto state = engine->read_state();
    ASSERT_FALSE(state);
    EXPECT_EQ(state.error().code, Errc::kBadFormat) << state.error().what;
    fault(0x1A00, Fault::kNone);
    EXPECT_TRUE(engine->read_state());
  }
}

TEST_F(Dlpc350Bus, MuteTakesTheLedsAndGivesThemBackAsTheyWere) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  for (const int enabled : {0x08, 0x05}) {
    set(0x1A07, {enabled});
    ASSERT_TRUE(engine->mute(true));
    EXPECT_EQ(value(0x1A07), std::vector<int>{0});
    EXPECT_EQ(engine->read_state()->muted, true);
    ASSERT_TRUE(engine->mute(true));  // twice is once
    ASSERT_TRUE(engine->mute(false));
    EXPECT_EQ(value(0x1A07), std::vector<int>{enabled});
  }
}

TEST_F(Dlpc350Bus, WhatLitTheLedsIsNotLostWhereAnotherProgramUnblanks) {
  device_.plug();
  set(0x1A07, {0x05});
  const auto before = open()->read_state();
  ASSERT_TRUE(before) << before.error().what;
  EXPECT_EQ(before->led_enable, "red blue");
  const auto blank_and_unblank = [this] {
    ASSERT_TRUE(open()->mute(true));
    const auto dark = open()->read_state();
    ASSERT_TRUE(dark) << dark.error().what;
    EXPECT_EQ(dark->muted, true);
    EXPECT_FALSE(dark->led_enable) << "nobody can tell while they are dark";
    ASSERT_TRUE(open()->mute(false));
  };
  options_.led_enable = "red blue";
  blank_and_unblank();
  EXPECT_EQ(value(0x1A07), std::vector<int>{0x05});
  EXPECT_TRUE(differences(*before, *open()->read_state()).empty());
  // Where nobody says so, they are as after the device's start, and that is seen to be a change.
  options_ = {};
  blank_and_unblank();
  EXPECT_EQ(value(0x1A07), std::vector<int>{0x08});
  const auto changes = differences(*before, *open()->read_state());
  ASSERT_EQ(changes.size(), 1U);
  EXPECT_THAT(changes.front(), HasSubstr("\"red blue\" and is \"sequencer\""));
  options_.led_enable = "all";
  EXPECT_EQ(Dlpc350::open(options_, clock_).error().code, Errc::kInvalidOption);
}

TEST_F(Dlpc350Bus, ATestPatternTakesTheInputAndKeepsItsWidth) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  ASSERT_TRUE(engine->show_test_pattern("step-bars"));
  EXPECT_EQ(value(0x1A00), std::vector<int>{0x09});
  EXPECT_EQ(value(0x1203), std::vector<int>{0x0A});
  EXPECT_EQ(engine->show_test_pattern("kitten").error().code, Errc::kInvalidOption);
  EXPECT_EQ(engine->select_input("hdmi").error().code, Errc::kInvalidOption);
  EXPECT_EQ(engine->set_led_levels({0, 0, 256}).error().code, Errc::kInvalidOption);
}

TEST_F(Dlpc350Bus, OneThatIsPulledOutIsDisconnectedForGood) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  device_.unplug();
  for (int i = 0; i < 2; ++i) {
    const auto state = engine->read_state();
    ASSERT_FALSE(state);
    EXPECT_EQ(state.error().code, Errc::kDisconnected);
  }
  device_.plug();
  EXPECT_EQ(engine->freeze(true).error().code, Errc::kDisconnected);
  const auto again = open();
  ASSERT_TRUE(again);
  EXPECT_TRUE(again->freeze(true));
}

TEST_F(Dlpc350Bus, OneThatFailsInTheMiddleIsDisconnected) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  fault(0x1A0C, Fault::kUnplug);
  EXPECT_EQ(engine->read_state().error().code, Errc::kDisconnected);
}

TEST_F(Dlpc350Bus, OneThatIsInterruptedSaysNoMore) {
  device_.plug();
  const auto engine = open();
  ASSERT_TRUE(engine);
  engine->interrupt();
  EXPECT_EQ(engine->read_state().error().code, Errc::kCancelled);
  EXPECT_EQ(engine->freeze(true).error().code, Errc::kCancelled);
  EXPECT_TRUE(take_received().empty());
}

TEST_F(Dlpc350Bus, AWatchSeesItsLedsTurnedAndItPulledOutAndPutInAgain) {
  device_.plug();
  const auto before = open()->read_state();
  ASSERT_TRUE(before) << before.error().what;
  const ControlWatch watch(
      [this]() -> Result<std::unique_ptr<ProjectorControl>> {
        return Dlpc350::open(options_, clock_);
      },
      to_record(*before),
      {.period = 20ms, .first_pause = 20ms, .longest_pause = 20ms});
  const auto wait_for = [&](const std::function<bool(const ControlReport&)>& is_it) {
    for (int i = 0; i < 1000 && !is_it(watch.report()); ++i) std::this_thread::sleep_for(10ms);
    return watch.report();
  };
  const ControlReport well = wait_for([](const auto& r) { return r.reachable; });
  ASSERT_TRUE(well.reachable) << well.text;
  EXPECT_TRUE(well.changes.empty());
  set(0x0B01, {155, 135, 164});  // one step of the blue LED
  const ControlReport turned = wait_for([](const auto& r) { return !r.changes.empty(); });
  ASSERT_EQ(turned.changes.size(), 1U);
  EXPECT_THAT(turned.changes.front(), HasSubstr("LED"));
  device_.unplug();
  EXPECT_FALSE(wait_for([](const auto& r) { return !r.reachable; }).reachable);
  set(0x0B01, {155, 135, 165});
  device_.plug();
  const ControlReport back = wait_for([](const auto& r) { return r.reachable; });
  EXPECT_TRUE(back.reachable) << back.text;
  EXPECT_TRUE(back.changes.empty());
}

TEST_F(Dlpc350Bus, TheRegistryOpensIt) {
  device_.plug();
  auto toml =
      TomlReader::parse("driver = \"dlpc350\"\nserial = \"LCR3\"\nled_enable = \"red\"", "test");
  ASSERT_TRUE(toml);
  const auto control = open_control(*toml, clock_);
  ASSERT_TRUE(control) << control.error().what;
  EXPECT_TRUE(toml->finish());
  EXPECT_EQ((*control)->read_state()->model, "DLPC350");
}

}  // namespace
}  // namespace veneer::projector
