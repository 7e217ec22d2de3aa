// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisers/elliptec/elliptec.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include <array>
#include <functional>
#include <limits>
#include <mutex>
#include <numbers>
#include <optional>
#include <thread>

#include "base/testing/temporary_folder.h"
#include "base/unique_handle.h"
#include "capture/polarisers/elliptec/protocol.h"

namespace veneer::capture {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kPulses = 143360;

/// An ELL14 at the other end of a pseudo-terminal. It answers byte by byte.
class FakeStage {
 public:
  /// What it says in place of its answer to the n-th request; nothing: its answer.
  using Fault = std::function<std::optional<std::string>(const std::string& request, int number)>;

  explicit FakeStage(Fault fault = {}) : fault_(std::move(fault)) {
    master_ = UniqueFd(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC));
    VENEER_CHECK(master_ && ::grantpt(master_.value()) == 0 && ::unlockpt(master_.value()) == 0);
    std::array<char, 128> name{};
    VENEER_CHECK(::ptsname_r(master_.value(), name.data(), name.size()) == 0);
    port_ = name.data();
    // So that the terminal lives on while nobody else has it open.
    slave_ = UniqueFd(::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
  }

  [[nodiscard]] ElliptecOptions options() const {
    ElliptecOptions options;
    options.port = port_;
    options.answer_time = std::chrono::milliseconds(200);
    options.move_time = std::chrono::milliseconds(400);
    return options;
  }
  [[nodiscard]] std::vector<std::string> requests() {
    const std::scoped_lock lock(mutex_);
    return requests_;
  }
  void unplug() {
    thread_.request_stop();
    thread_.join();
    slave_.reset();
    master_.reset();
  }

 private:
  void serve(const std::stop_token& stop) {
    std::string come;
    while (!stop.stop_requested()) {
      pollfd poll{master_.value(), POLLIN, 0};
      if (::poll(&poll, 1, 5) <= 0) continue;
      char byte = 0;
      if (::read(master_.value(), &byte, 1) != 1) continue;
      come += byte;
      const std::size_t length = come.size() < 3             ? 3
                                 : come.substr(1, 2) == "ma" ? 11
                                 : come.substr(1, 2) == "ho" ? 4
                                                             : 3;
      if (come.size() < length) continue;
      answer(std::exchange(come, {}));
    }
  }

  void answer(const std::string& request) {
    int number = 0;
    {
      const std::scoped_lock lock(mutex_);
      number = static_cast<int>(requests_.size());
      requests_.push_back(request);
    }
    std::optional<std::string> text;
    if (fault_) text = fault_(request, number);
    if (!text) text = good_answer(request);
    for (const char each : *text) {
      (void)!::write(master_.value(), &each, 1);
      std::this_thread::sleep_for(std::chrono::microseconds(300));
    }
  }

  std::string good_answer(const std::string& request) {
    const std::string command = request.substr(1, 2);
    if (command == "in") return "0IN0E1140051720231701016800023000\r\n";
    if (command == "gs") return "0GS00\r\n";
    if (command == "ho") position_ = 0;
    if (command == "ma") position_ = static_cast<int>(std::stoul(request.substr(3), nullptr, 16));
    return fmt::format("0PO{:08X}\r\n", position_);
  }

  Fault fault_;
  UniqueFd master_, slave_;
  std::filesystem::path port_;
  std::mutex mutex_;
  std::vector<std::string> requests_;
  int position_ = 0;
  std::jthread thread_;  // the last: it uses all the others
};

TEST(Elliptec, SaysWhatTheProtocolAsksFor) {
  FakeStage stage;
  const auto polariser = open_elliptec(stage.options());
  ASSERT_TRUE(polariser) << polariser.error().what;
  EXPECT_THAT((*polariser)->description(), HasSubstr("ELL14 11400517"));
  ASSERT_TRUE((*polariser)->turn_to(0));
  ASSERT_TRUE((*polariser)->turn_to(90 * kDegree));
  // A quarter of 143360 is 35840, 8C00.
  EXPECT_THAT(stage.requests(), ElementsAre("0in", "0ho0", "0ma00000000", "0ma00008C00"));
}

// The axis is the same after half a turn; the stage goes to the nearer position, within a turn.
TEST(Elliptec, TakesTheNearerOfTwoPositions) {
  for (const bool reversed : {false, true}) {
    FakeStage stage;
    ElliptecOptions options = stage.options();
    options.zero_deg = 30;
    options.reversed = reversed;
    const auto polariser = open_elliptec(options);
    ASSERT_TRUE(polariser) << polariser.error().what;
    double here = 0;
    for (const double angle : {0.0, 90.0, 135.0, 180.0, 45.0, -90.0, 720.0, 0.0}) {
      ASSERT_TRUE((*polariser)->turn_to(angle * kDegree));
      const auto pulses =
          static_cast<double>(std::stoul(stage.requests().back().substr(3), nullptr, 16));
      const double there = pulses * 360 / kPulses;
      EXPECT_GE(there, 0);
      EXPECT_LT(there, 360);
      const double wanted = 30 + (reversed ? -angle : angle);
      EXPECT_NEAR(std::remainder(there - wanted, 180), 0, 360.0 / kPulses) << angle;
      const double other = there < 180 ? there + 180 : there - 180;
      EXPECT_LE(std::abs(there - here), std::abs(other - here) + 360.0 / kPulses) << angle;
      here = there;
    }
    EXPECT_EQ((*polariser)->turn_to(std::numeric_limits<double>::quiet_NaN()).error().code,
              Errc::kInvalidOption);
  }
}

TEST(Elliptec, WithoutHomingStartsFromWhereItIs) {
  FakeStage stage;
  ElliptecOptions options = stage.options();
  options.home = false;
  ASSERT_TRUE(open_elliptec(options));
  EXPECT_THAT(stage.requests(), ElementsAre("0in", "0gp"));
}

TEST(Elliptec, AsksAgainAfterGarbageSilenceAndHalfALine) {
  for (const std::string& text : {std::string("\xff\x01?\r\n"),
                                  std::string(),
                                  std::string("0PO0000"),
                                  std::string("0PO12\r\n"),
                                  std::string(300, 'x'),
                                  std::string("\r\n"),
                                  std::string("0GS09\r\n")}) {
    // Each first request of its kind fails.
    std::string last;
    FakeStage stage([&](const std::string& request, int) -> std::optional<std::string> {
      if (std::exchange(last, request) == request) return std::nullopt;
      return text;
    });
    const auto polariser = open_elliptec(stage.options());
    if (text == "0PO12\r\n") {
      // It looks like an answer to the search for the mark, and is none.
      ASSERT_FALSE(polariser);
      EXPECT_EQ(polariser.error().code, Errc::kBadFormat);
      continue;
    }
    ASSERT_TRUE(polariser) << text << ": " << polariser.error().what;
    EXPECT_TRUE((*polariser)->turn_to(1)) << text;
    EXPECT_GE(stage.requests().size(), 6U) << text;
  }
}

struct FaultCase {
  std::string answer;
  Errc code;
  std::string said;
};

TEST(Elliptec, SaysWhatIsWrongAndWhatToDo) {
  const std::vector<FaultCase> cases{
      {"0GS02\r\n", Errc::kBadFormat, "mechanical time out"},
      {"0GS0B\r\n", Errc::kBadFormat, "motor"},
      {"0GS7F\r\n", Errc::kBadFormat, "status 127"},
      {"0GS09\r\n", Errc::kTimeout, "busy"},
      {"", Errc::kTimeout, "power"},
      {"garbage\r\n", Errc::kBadFormat, "garbage"},
      {"0PO00000100\r\n", Errc::kBadFormat, "beside it"},
      {"3PO00000000\r\n", Errc::kInvalidOption, "polariser.address"},
  };
  for (const FaultCase& each : cases) {
    FakeStage stage([&](const std::string& request, int) -> std::optional<std::string> {
      if (request.substr(1, 2) != "ma") return std::nullopt;
      return each.answer;
    });
    const auto polariser = open_elliptec(stage.options());
    ASSERT_TRUE(polariser) << polariser.error().what;
    const Status turned = (*polariser)->turn_to(1);
    ASSERT_FALSE(turned) << each.answer;
    EXPECT_EQ(turned.error().code, each.code) << turned.error().what;
    EXPECT_THAT(turned.error().what, HasSubstr(each.said));
    EXPECT_THAT(turned.error().what, HasSubstr("turning the analyser"));
  }
}

TEST(Elliptec, RefusesWhatDoesNotTurn) {
  for (const char* answer : {"0IN071140051720231701003C00000400\r\n",    // a linear stage
                             "0IN0E1140051720231701016800000000\r\n",    // no pulses
                             "0IN0E114005172023170101680002300\r\n"}) {  // a digit lost
    FakeStage stage([&](const std::string&, int) { return std::optional<std::string>(answer); });
    EXPECT_FALSE(open_elliptec(stage.options())) << answer;
  }
}

TEST(Elliptec, NoticesThatTheCableIsOut) {
  FakeStage stage;
  const auto polariser = open_elliptec(stage.options());
  ASSERT_TRUE(polariser) << polariser.error().what;
  stage.unplug();
  const Status turned = (*polariser)->turn_to(1);
  ASSERT_FALSE(turned);
  EXPECT_EQ(turned.error().code, Errc::kDisconnected) << turned.error().what;
}

TEST(Elliptec, SaysWhyAPortDoesNotOpen) {
  FakeStage stage;
  const auto first = open_elliptec(stage.options());
  ASSERT_TRUE(first);
  EXPECT_EQ(open_elliptec(stage.options()).error().code, Errc::kUnavailable);
  ElliptecOptions options = stage.options();
  options.port = "/dev/serial/by-id/none";
  const auto missing = open_elliptec(options);
  EXPECT_EQ(missing.error().code, Errc::kNotFound);
  EXPECT_THAT(missing.error().what, HasSubstr("plug"));
  options.port = "/dev/null";
  EXPECT_EQ(open_elliptec(options).error().code, Errc::kInvalidOption);
}

TEST(ElliptecProtocol, PositionsSurviveTheWay) {
  for (const std::int32_t pulses : {0,
                                    1,
                                    -1,
                                    kPulses,
                                    std::numeric_limits<std::int32_t>::max(),
                                    std::numeric_limits<std::int32_t>::min()}) {
    const std::string request = elliptec::move_request('A', pulses);
    ASSERT_EQ(request.size(), 11U);
    const auto reply = elliptec::parse_reply("APO" + request.substr(3));
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->address, 'A');
    EXPECT_EQ(elliptec::parse_position(*reply).value(), pulses);
  }
}

}  // namespace
}  // namespace veneer::capture
