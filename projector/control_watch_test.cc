// SPDX-License-Identifier: Apache-2.0
#include "projector/control_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>

#include "projector/control/pjlink/fake_projector.h"
#include "projector/control/pjlink/pjlink.h"

namespace veneer::projector {
namespace {

using namespace std::chrono_literals;
using pjlink::FakeProjector;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Real time, but short: a question every few milliseconds.
ControlWatchOptions quick() { return {.period = 5ms, .first_pause = 5ms, .longest_pause = 20ms}; }

/// Waits for a report that `is_it` likes; the last one where none comes in time.
ControlReport wait_for(const ControlWatch& watch,
                       const std::function<bool(const ControlReport&)>& is_it) {
  const auto end = std::chrono::steady_clock::now() + 10s;
  while (!is_it(watch.report()) && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(1ms);
  return watch.report();
}
bool is_reachable(const ControlReport& report) { return report.reachable; }

/// A projector that does what the test says.
struct Script {
  std::mutex mutex;
  ProjectorState state;
  std::optional<Error> failure;       // of the next readings
  std::optional<Error> open_failure;  // of the next openings
  bool hangs = false;                 // until it is interrupted
  std::atomic<bool> interrupted{false};
  std::atomic<int> opened{0};
  std::atomic<int> closed{0};
  std::atomic<int> asked{0};

  void set(const std::function<void(Script&)>& change) {
    const std::lock_guard lock(mutex);
    change(*this);
  }
};

class ScriptedControl final : public ProjectorControl {
 public:
  explicit ScriptedControl(Script& script) : script_(script) { ++script_.opened; }
  ~ScriptedControl() override { ++script_.closed; }
  [[nodiscard]] std::string description() const override { return "scripted projector"; }
  void interrupt() override { script_.interrupted = true; }
  [[nodiscard]] Result<ProjectorState> read_state() override {
    ++script_.asked;
    bool hangs = false;
    script_.set([&](Script& s) { hangs = s.hangs; });
    while (hangs && !script_.interrupted) std::this_thread::sleep_for(1ms);
    if (script_.interrupted) return fail(Errc::kCancelled, "interrupted");
    const std::lock_guard lock(script_.mutex);
    if (script_.failure) return tl::unexpected<Error>(*script_.failure);
    return script_.state;
  }
  [[nodiscard]] Status power(bool) override { return {}; }
  [[nodiscard]] Status mute(bool) override { return {}; }
  [[nodiscard]] Status freeze(bool) override { return {}; }
  [[nodiscard]] Status select_input(const std::string&) override { return {}; }

 private:
  Script& script_;
};

ControlWatch::Open opener_of(Script& script) {
  return [&script]() -> Result<std::unique_ptr<ProjectorControl>> {
    const std::lock_guard lock(script.mutex);
    if (script.open_failure) return tl::unexpected<Error>(*script.open_failure);
    return std::make_unique<ScriptedControl>(script);
  };
}

ProjectorState lit() {
  ProjectorState state;
  state.power = Power::kOn;
  state.input = "digital1";
  state.muted = false;
  state.lamps = {{100, true}};
  return state;
}

TEST(ControlWatch, SaysNothingBeforeItKnowsAnything) {
  Script script;
  script.hangs = true;
  const ControlWatch watch(opener_of(script), {}, quick());
  const ControlReport report = watch.report();
  EXPECT_FALSE(report.asked);
  EXPECT_FALSE(report.reachable);
  EXPECT_FALSE(report.state);
  EXPECT_THAT(report.changes, IsEmpty());
}

TEST(ControlWatch, AProjectorAsItWasHasNoChanges) {
  Script script;
  script.state = lit();
  const Time before = SteadyClock{}.now();
  const ControlWatch watch(opener_of(script), to_record(lit()), quick());
  const ControlReport report = wait_for(watch, is_reachable);
  EXPECT_TRUE(report.asked);
  EXPECT_EQ(report.failures, 0);
  EXPECT_EQ(report.state, lit());
  EXPECT_GE(report.read, before);
  EXPECT_LE(report.read, SteadyClock{}.now());
  EXPECT_THAT(report.changes, IsEmpty());
  EXPECT_THAT(report.warnings, IsEmpty());
  EXPECT_EQ(report.text, "scripted projector: on, input digital1, lamp 100 h");
}

TEST(ControlWatch, TellsWhatChangedAndWhatIsChangedBack) {
  Script script;
  script.state = lit();
  const ControlWatch watch(opener_of(script), to_record(lit()), quick());
  ASSERT_TRUE(wait_for(watch, is_reachable).reachable);
  script.set([](Script& s) { s.state.muted = true; });
  const ControlReport changed =
      wait_for(watch, [](const ControlReport& r) { return !r.changes.empty(); });
  EXPECT_THAT(changed.changes, ElementsAre(HasSubstr("mute")));
  EXPECT_THAT(changed.warnings, ElementsAre(HasSubstr("blanked")));
  EXPECT_TRUE(changed.reachable);
  script.set([](Script& s) { s.state = lit(); });
  EXPECT_THAT(wait_for(watch, [](const ControlReport& r) { return r.changes.empty(); }).changes,
              IsEmpty());
}

TEST(ControlWatch, WhatTheProfileDoesNotKnowIsNoDifference) {
  Script script;
  script.state = lit();
  const ControlWatch watch(
      opener_of(script), {{"instrument", "i1"}, {"projector.input", "digital1"}}, quick());
  const ControlReport report = wait_for(watch, is_reachable);
  EXPECT_TRUE(report.reachable);
  EXPECT_THAT(report.changes, IsEmpty());
}

TEST(ControlWatch, AnotherProfileIsComparedWithAtOnce) {
  Script script;
  script.state = lit();
  script.state.degamma = true;
  ControlWatch watch(
      opener_of(script), to_record(lit()), {.period = 1h, .first_pause = 1h, .longest_pause = 1h});
  ASSERT_TRUE(wait_for(watch, is_reachable).reachable);
  ProjectorState other = lit();
  other.input = "digital2";
  watch.keep(to_record(other));
  EXPECT_THAT(watch.report().changes, ElementsAre(HasSubstr("digital2")));
  EXPECT_THAT(watch.report().warnings, ElementsAre(HasSubstr("degamma")));
  other.degamma = true;
  watch.keep(to_record(other));
  EXPECT_THAT(watch.report().warnings, IsEmpty());
  watch.keep({});
  EXPECT_THAT(watch.report().changes, IsEmpty());
  EXPECT_EQ(script.asked, 1);
}

TEST(ControlWatch, OneThatIsLostAndComesBackIsSaidToBe) {
  Script script;
  script.state = lit();
  script.state.muted = true;
  const ControlWatch watch(opener_of(script), to_record(lit()), quick());
  ASSERT_TRUE(wait_for(watch, is_reachable).reachable);
  script.set([](Script& s) { s.failure = Error{Errc::kDisconnected, "it hung up"}; });
  const ControlReport lost =
      wait_for(watch, [](const ControlReport& r) { return r.failures >= 3; });
  EXPECT_GE(lost.failures, 3);
  EXPECT_FALSE(lost.reachable);
  EXPECT_EQ(lost.text, "it hung up");
  EXPECT_THAT(lost.changes, ElementsAre(HasSubstr("mute")));  // as last seen
  script.set([](Script& s) {
    s.failure.reset();
    s.open_failure = Error{Errc::kNotFound, "it is not there"};
  });
  EXPECT_EQ(
      wait_for(watch, [](const ControlReport& r) { return r.text == "it is not there"; }).text,
      "it is not there");
  script.set([](Script& s) {
    s.open_failure.reset();
    s.state = lit();
  });
  const ControlReport back = wait_for(watch, is_reachable);
  EXPECT_TRUE(back.reachable);
  EXPECT_EQ(back.failures, 0);
  EXPECT_THAT(back.changes, IsEmpty());
}

TEST(ControlWatch, PausesGrowWithFailuresUpToTheLongest) {
  Script script;
  script.failure = Error{Errc::kTimeout, "no answer"};
  const auto start = std::chrono::steady_clock::now();
  const ControlWatch watch(
      opener_of(script), {}, {.period = 1ms, .first_pause = 10ms, .longest_pause = 40ms});
  const ControlReport report =
      wait_for(watch, [](const ControlReport& r) { return r.failures >= 5; });
  // 10, 20, 40, 40 between five of them; how much longer, the machine's load says.
  EXPECT_GE(std::chrono::steady_clock::now() - start, 110ms);
  EXPECT_GE(report.failures, 5);
}

TEST(ControlWatch, OthersCanSpeakWithItBetweenTwoQuestions) {
  Script script;
  script.state = lit();
  const ControlWatch watch(
      opener_of(script), {}, {.period = 1h, .first_pause = 1h, .longest_pause = 1h});
  ASSERT_TRUE(wait_for(watch, is_reachable).reachable);
  EXPECT_EQ(script.opened, 1);
  EXPECT_EQ(script.closed, 1);
}

TEST(ControlWatch, NeitherItsReaderNorItsEndWaitsForAProjectorThatHangs) {
  Script script;
  script.hangs = true;
  const auto start = std::chrono::steady_clock::now();
  {
    ControlWatch watch(opener_of(script), {}, quick());
    while (script.asked == 0) std::this_thread::sleep_for(1ms);
    for (int i = 0; i < 1000; ++i) static_cast<void>(watch.report());
    watch.keep({{"projector.input", "digital1"}});
    EXPECT_FALSE(watch.report().asked);
  }
  EXPECT_TRUE(script.interrupted);
  EXPECT_EQ(script.opened, script.closed);
  EXPECT_LT(std::chrono::steady_clock::now() - start, 2s);  // it would hang for ever
}

TEST(ControlWatch, EndsAtOnceBetweenTwoQuestions) {
  Script script;
  script.state = lit();
  const auto start = std::chrono::steady_clock::now();
  {
    const ControlWatch watch(
        opener_of(script), {}, {.period = 1h, .first_pause = 1h, .longest_pause = 1h});
    ASSERT_TRUE(wait_for(watch, is_reachable).reachable);
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, 2s);
}

ControlWatchOptions read(const std::string& text, bool& good) {
  TomlReader toml = TomlReader::parse(text, "veneer.toml").value();
  TomlReader table = toml.table("control");
  const ControlWatchOptions options = ControlWatchOptions::read(table);
  table.ignore_the_rest();
  good = toml.finish().has_value();
  return options;
}

TEST(ControlWatchOptions, ProjectorsOnTheNetworkAreNotAskedTooOften) {
  bool good = false;
  EXPECT_EQ(read("[control]\ndriver = \"pjlink\"\n", good).period, 30s);
  EXPECT_TRUE(good);
  EXPECT_EQ(read("[control]\ndriver = \"pjlink\"\npoll_s = 10\n", good).period, 10s);
  EXPECT_TRUE(good);
  EXPECT_EQ(read("[control]\ndriver = \"dlpc350\"\npoll_s = 1\n", good).period, 1s);
  EXPECT_TRUE(good);
  for (const char* wrong : {"driver = \"pjlink\"\npoll_s = 9.99",
                            "driver = \"dlpc350\"\npoll_s = 0.9",
                            "poll_s = 0",
                            "poll_s = -5",
                            "poll_s = nan",
                            "poll_s = inf",
                            "poll_s = 3601",
                            "poll_s = \"often\""}) {
    const ControlWatchOptions options = read(std::string("[control]\n") + wrong + "\n", good);
    EXPECT_FALSE(good) << wrong;
    EXPECT_TRUE(options.check()) << wrong;  // whatever the file says, what is returned can be used
  }
}

TEST(ControlWatchOptions, PeriodsAndPausesAreAboveZero) {
  EXPECT_TRUE(ControlWatchOptions{}.check());
  EXPECT_FALSE((ControlWatchOptions{.period = 0s}.check()));
  EXPECT_FALSE((ControlWatchOptions{.first_pause = -1s}.check()));
  EXPECT_FALSE((ControlWatchOptions{.first_pause = 2s, .longest_pause = 1s}.check()));
}

TEST(SummaryOf, SaysInALineWhatMatters) {
  EXPECT_EQ(summary_of({}), "it tells nothing of itself");
  ProjectorState state = lit();
  state.frozen = true;
  state.muted = true;
  state.locked = false;
  state.lamps = {{100, true}, {7, false}};
  state.led_levels = LedLevels{1, 2, 3};
  state.health = {{"fan", Health::kOk}, {"filter", Health::kWarning}};
  EXPECT_EQ(summary_of(state),
            "on, input digital1, blanked, frozen, no signal, lamp 100 h, lamp 7 h (off), "
            "LEDs 1 2 3, filter warning");
}

// The driver and a projector on the loopback.

FakeProjector::Behaviour lit_projector() {
  FakeProjector::Behaviour behaviour;
  behaviour.replies = {{"%1CLSS ?\r", "%1CLSS=1\r"},
                       {"%1POWR ?\r", "%1POWR=1\r"},
                       {"%1INPT ?\r", "%1INPT=31\r"},
                       {"%1AVMT ?\r", "%1AVMT=30\r"},
                       {"%1ERST ?\r", "%1ERST=000000\r"},
                       {"%1LAMP ?\r", "%1LAMP=1234 1\r"},
                       {"%1INF2 ?\r", "%1INF2=Model\r"}};
  return behaviour;
}

class PjlinkWatch : public ::testing::Test {
 protected:
  ControlWatch::Open opener(int port, Duration limit = 5s) {
    return [this, port, limit]() -> Result<std::unique_ptr<ProjectorControl>> {
      PjlinkOptions options;
      options.host = "127.0.0.1";
      options.port = port;
      options.time_limit = limit;
      return std::make_unique<Pjlink>(options, clock_);
    };
  }
  SteadyClock clock_;
};

TEST_F(PjlinkWatch, SeesItSwitchedOffTheLampReplacedAndTheInputSwitched) {
  FakeProjector projector(lit_projector());
  ControlRecord kept;
  {
    const ControlWatch first(opener(projector.port()), {}, quick());
    const ControlReport report = wait_for(first, is_reachable);
    ASSERT_TRUE(report.state) << report.text;
    kept = to_record(*report.state);
  }
  const ControlWatch watch(opener(projector.port()), kept, quick());
  EXPECT_THAT(wait_for(watch, is_reachable).changes, IsEmpty());
  const auto expect_change = [&](const char* request,
                                 const std::string& reply,
                                 const std::string& back,
                                 const char* text) {
    projector.reply(request, reply);
    const ControlReport changed =
        wait_for(watch, [](const ControlReport& r) { return !r.changes.empty(); });
    EXPECT_THAT(changed.changes, ElementsAre(HasSubstr(text)));
    projector.reply(request, back);
    EXPECT_THAT(wait_for(watch, [](const ControlReport& r) { return r.changes.empty(); }).changes,
                IsEmpty());
  };
  expect_change("%1POWR ?\r", "%1POWR=0\r", "%1POWR=1\r", "power");
  expect_change("%1LAMP ?\r", "%1LAMP=3 1\r", "%1LAMP=1240 1\r", "replaced");
  expect_change("%1INPT ?\r", "%1INPT=32\r", "%1INPT=31\r", "digital2");
}

TEST_F(PjlinkWatch, OneThatGoesFromTheNetworkIsLostUntilItIsThereAgain) {
  auto projector = std::make_unique<FakeProjector>(lit_projector());
  const int port = projector->port();
  const ControlWatch watch(opener(port), {}, quick());
  ASSERT_TRUE(wait_for(watch, is_reachable).reachable);
  projector.reset();
  // The first failure may be that of a question which was under way.
  const ControlReport lost = wait_for(
      watch, [](const ControlReport& r) { return r.text.find("switch PJLink") < r.text.size(); });
  EXPECT_FALSE(lost.reachable);
  EXPECT_THAT(lost.text, HasSubstr("nobody listens"));
  projector = std::make_unique<FakeProjector>(lit_projector(), port);
  const ControlReport back = wait_for(watch, is_reachable);
  EXPECT_TRUE(back.reachable) << back.text;
}

TEST_F(PjlinkWatch, EndsWhileTheProjectorKeepsItWaiting) {
  FakeProjector::Behaviour silent = lit_projector();
  silent.replies["%1INPT ?\r"] = "...";
  FakeProjector projector(silent);
  const auto start = std::chrono::steady_clock::now();
  {
    const ControlWatch watch(opener(projector.port(), 60s), {}, quick());
    while (projector.conversations().empty() ||
           projector.conversations().back().find("INPT") == std::string::npos)
      std::this_thread::sleep_for(1ms);
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, 5s);  // far below the time limit
}

}  // namespace
}  // namespace veneer::projector
