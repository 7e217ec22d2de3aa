// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/name_lookup.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/eventfd.h>

#include <atomic>
#include <condition_variable>
#include <cstring>
#include <memory>
#include <mutex>
#include <thread>

#include "base/unique_handle.h"
#include "projector/control/pjlink/fake_projector.h"
#include "projector/control/pjlink/pjlink.h"
#include "projector/control_watch.h"

namespace veneer::projector {
namespace {

using namespace std::chrono_literals;
using pjlink::FakeProjector;
using pjlink::look_up;
using pjlink::LookedUp;
using pjlink::Resolve;
using ::testing::HasSubstr;

/// Far below what a hanging look-up would take, and far above what an idle machine needs.
constexpr auto kSoon = 2s;
constexpr const char* kName = "projector.invalid";  // RFC 6761: no name server knows it

/// A name server that answers nobody until it is let go of; shared with threads that outlive a
/// test.
class HangingServer {
 public:
  HangingServer() : state_(std::make_shared<State>()) {}
  ~HangingServer() {
    std::unique_lock lock(state_->mutex);
    state_->released = true;
    state_->changed.notify_all();
    state_->changed.wait(lock, [this] { return state_->hanging == 0; });
  }
  HangingServer(const HangingServer&) = delete;
  HangingServer& operator=(const HangingServer&) = delete;

  [[nodiscard]] Resolve resolve() const {
    return [state = state_](const std::string&, int) {
      std::unique_lock lock(state->mutex);
      ++state->asked;
      ++state->hanging;
      state->changed.notify_all();
      state->changed.wait(lock, [&] { return state->released; });
      --state->hanging;
      state->changed.notify_all();
      return LookedUp{EAI_AGAIN, {}};
    };
  }
  [[nodiscard]] int asked() const {
    const std::lock_guard lock(state_->mutex);
    return state_->asked;
  }
  void wait_until_asked() const {
    std::unique_lock lock(state_->mutex);
    state_->changed.wait(lock, [this] { return state_->asked > 0; });
  }

 private:
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    int asked = 0;
    int hanging = 0;
    bool released = false;
  };
  std::shared_ptr<State> state_;
};

class NameLookUp : public ::testing::Test {
 protected:
  [[nodiscard]] auto ask(const std::string& host, const Resolve& resolve, Duration limit) const {
    return look_up(host, 4352, SteadyClock{}.now() + limit, stop_.value(), resolve);
  }
  PjlinkOptions options_of(const std::string& host, const Resolve& resolve, Duration limit) const {
    PjlinkOptions options;
    options.host = host;
    options.time_limit = limit;
    options.resolve = resolve;
    return options;
  }
  SteadyClock clock_;
  UniqueFd stop_{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
};

TEST_F(NameLookUp, NumbersNeedNoNameServer) {
  const HangingServer server;
  for (const auto& [host, family] : {std::pair{"127.0.0.1", AF_INET}, std::pair{"::1", AF_INET6}}) {
    const auto found = ask(host, server.resolve(), 0s);
    ASSERT_TRUE(found) << found.error().what;
    ASSERT_EQ(found->size(), 1U);
    EXPECT_EQ(found->front().address.ss_family, family);
  }
  EXPECT_EQ(server.asked(), 0);
  sockaddr_in v4{};
  std::memcpy(&v4, &ask("192.0.2.7", server.resolve(), 0s)->front().address, sizeof(v4));
  EXPECT_EQ(ntohs(v4.sin_port), 4352);
  EXPECT_EQ(ntohl(v4.sin_addr.s_addr), 0xC0000207U);
}

TEST_F(NameLookUp, AServerThatHangsIsWaitedForNoLongerThanTheLimit) {
  const HangingServer server;
  Pjlink control(options_of(kName, server.resolve(), 100ms), clock_);
  const Time start = clock_.now();
  const auto state = control.read_state();
  EXPECT_GE(clock_.now() - start, 100ms);
  EXPECT_LT(clock_.now() - start, kSoon);
  ASSERT_FALSE(state);
  EXPECT_EQ(state.error().code, Errc::kNotFound);
  EXPECT_THAT(state.error().what, HasSubstr("name server"));
  EXPECT_THAT(state.error().what, HasSubstr(kName));
}

TEST_F(NameLookUp, InterruptEndsIt) {
  const HangingServer server;
  Pjlink control(options_of(kName, server.resolve(), 1h), clock_);
  std::thread other([&] {
    server.wait_until_asked();
    control.interrupt();
  });
  const Time start = clock_.now();
  const auto state = control.read_state();
  EXPECT_LT(clock_.now() - start, kSoon);
  other.join();
  ASSERT_FALSE(state);
  EXPECT_EQ(state.error().code, Errc::kCancelled);
}

TEST_F(NameLookUp, TheEndOfAWatchDoesNotWaitForIt) {
  const HangingServer server;
  const PjlinkOptions options = options_of(kName, server.resolve(), 1h);
  auto watch = std::make_unique<ControlWatch>(
      [&]() -> Result<std::unique_ptr<ProjectorControl>> {
        return std::make_unique<Pjlink>(options, clock_);
      },
      ControlRecord{},
      ControlWatchOptions{});
  server.wait_until_asked();
  const Time start = clock_.now();
  watch.reset();
  EXPECT_LT(clock_.now() - start, kSoon);
}

TEST_F(NameLookUp, ThoseThatHangDoNotPileUp) {
  constexpr int kEnough = 20;
  {
    const HangingServer server;
    Errc last = Errc::kNotFound;
    for (int i = 0; i < kEnough; ++i) last = ask(kName, server.resolve(), 20ms).error().code;
    EXPECT_EQ(last, Errc::kUnavailable);
    EXPECT_GE(server.asked(), 1);
    EXPECT_LE(server.asked(), 4);
    EXPECT_TRUE(ask("127.0.0.1", server.resolve(), 0s));
  }
  // Those that were let go of make room; they say so a moment after they are done.
  const Resolve knows_nothing = [](const std::string&, int) { return LookedUp{EAI_NONAME, {}}; };
  const Time end = clock_.now() + kSoon;
  auto again = ask(kName, knows_nothing, 1min);
  while (again.error().code != Errc::kNotFound && clock_.now() < end)
    again = ask(kName, knows_nothing, 1min);
  EXPECT_EQ(again.error().code, Errc::kNotFound);
  EXPECT_THAT(again.error().what, HasSubstr("check the name"));
}

TEST_F(NameLookUp, ARealNameIsConnectedTo) {
  const FakeProjector projector(FakeProjector::well());
  PjlinkOptions options = options_of("localhost", pjlink::resolve_by_system, 5s);
  options.port = projector.port();
  const auto state = Pjlink(options, clock_).read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->name, "Hall 3");
}

TEST_F(NameLookUp, OneWithoutAnAddressIsNotFound) {
  const Resolve empty = [](const std::string&, int) { return LookedUp{}; };
  const auto state = Pjlink(options_of(kName, empty, 5s), clock_).read_state();
  ASSERT_FALSE(state);
  EXPECT_EQ(state.error().code, Errc::kNotFound);
}

}  // namespace
}  // namespace veneer::projector
