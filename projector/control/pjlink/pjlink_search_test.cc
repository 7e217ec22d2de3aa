// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/pjlink_search.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <thread>

#include "base/unique_handle.h"

namespace veneer::projector::pjlink {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// Answers every datagram with those that it was given, from an address of the loopback.
class FakeResponder {
 public:
  FakeResponder(const std::string& address, int port, std::vector<std::string> answers)
      : answers_(std::move(answers)), fd_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_port = htons(static_cast<std::uint16_t>(port));
    ::inet_pton(AF_INET, address.c_str(), &own.sin_addr);
    socklen_t size = sizeof(own);
    auto* const generic = reinterpret_cast<sockaddr*>(&own);
    VENEER_CHECK(::bind(fd_.value(), generic, size) == 0);
    VENEER_CHECK(::getsockname(fd_.value(), generic, &size) == 0);
    port_ = ntohs(own.sin_port);
    thread_ = std::thread([this] { serve(); });
  }
  ~FakeResponder() {
    stopping_ = true;
    thread_.join();
  }
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] std::vector<std::string> questions() const {
    const std::scoped_lock lock(mutex_);
    return questions_;
  }

 private:
  void serve() {
    while (!stopping_) {
      pollfd entry{fd_.value(), POLLIN, 0};
      if (::poll(&entry, 1, 5) <= 0) continue;
      std::array<char, 256> buffer{};
      sockaddr_in from{};
      socklen_t size = sizeof(from);
      const ssize_t count = ::recvfrom(
          fd_.value(), buffer.data(), buffer.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
      if (count < 0) continue;
      {
        const std::scoped_lock lock(mutex_);
        questions_.emplace_back(buffer.data(), static_cast<std::size_t>(count));
      }
      for (const std::string& answer : answers_)
        ::sendto(fd_.value(),
                 answer.data(),
                 answer.size(),
                 0,
                 reinterpret_cast<const sockaddr*>(&from),
                 size);
    }
  }
  std::vector<std::string> answers_;
  mutable std::mutex mutex_;
  std::vector<std::string> questions_;
  UniqueFd fd_;
  int port_ = 0;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

SearchOptions towards(const std::string& address, int port) {
  return {.address = address, .port = port, .wait = 200ms};
}

TEST(PjlinkSearch, WhoAnswersIsFoundOnceWithItsNumber) {
  const std::string answer = "%2ACKN=00:11:22:aa:bb:cc\r";
  FakeResponder projector("127.0.0.1", 0, {answer, answer});
  const auto found = search(towards("127.0.0.1", projector.port()));
  ASSERT_TRUE(found) << found.error().what;
  EXPECT_THAT(*found, ElementsAre(FoundProjector{"127.0.0.1", "00:11:22:aa:bb:cc"}));
  EXPECT_THAT(projector.questions(), ElementsAre("%2SRCH\r"));
}

TEST(PjlinkSearch, WhatIsNoAnswerIsPassedOver) {
  FakeResponder stranger("127.0.0.1",
                         0,
                         {"",
                          "\r",
                          "%2SRCH\r",
                          "%1ACKN=00:11:22:aa:bb:cc\r",
                          "%2ACKN=\r",
                          "%2ACKN=00:11:22:aa:bb:cc:dd\r",
                          "%2ACKN=00:11:22:aa:bb:gg\r",
                          std::string(60000, 'x')});
  const auto found = search(towards("127.0.0.1", stranger.port()));
  ASSERT_TRUE(found) << found.error().what;
  EXPECT_THAT(*found, IsEmpty());
}

TEST(PjlinkSearch, NobodyThereEndsWhenTheTimeIsOver) {
  int port = 0;
  {
    const FakeResponder gone("127.0.0.1", 0, {});
    port = gone.port();
  }
  const auto start = std::chrono::steady_clock::now();
  const auto found = search(towards("127.0.0.1", port));
  const auto took = std::chrono::steady_clock::now() - start;
  ASSERT_TRUE(found) << found.error().what;
  EXPECT_THAT(*found, IsEmpty());
  EXPECT_GE(took, 199ms);
  EXPECT_LT(took, 5s);
}

TEST(PjlinkSearch, WrongOptionsAreRefused) {
  for (const SearchOptions& wrong : {SearchOptions{.address = ""},
                                     SearchOptions{.address = "projector"},
                                     SearchOptions{.address = "::1"},
                                     SearchOptions{.port = 0},
                                     SearchOptions{.port = 65536},
                                     SearchOptions{.wait = 0s},
                                     SearchOptions{.wait = 61s}}) {
    const auto found = search(wrong);
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().code, Errc::kInvalidOption) << found.error().what;
  }
}

}  // namespace
}  // namespace veneer::projector::pjlink
