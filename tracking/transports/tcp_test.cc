// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/tcp.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <ctime>
#include <thread>

#include "tracking/testing/loopback.h"

namespace veneer::tracking {
namespace {

using namespace std::chrono_literals;

Time now() { return SteadyClock{}.now(); }

/// Opens and accepts a connection; both ends.
struct Connection {
  std::unique_ptr<Transport> ours;
  UniqueFd theirs;

  static Connection to(const UniqueFd& listener, const std::string& host) {
    SteadyClock clock;
    auto opened = TcpPort(host, loopback::port_of(listener), clock).open();
    EXPECT_TRUE(opened) << opened.error().what;
    return {opened ? *std::move(opened) : nullptr,
            UniqueFd(::accept(listener.value(), nullptr, nullptr))};
  }
};

UniqueFd listening_socket(int port = 0, int family = AF_INET) {
  UniqueFd fd = loopback::bound_socket(SOCK_STREAM, port, family);
  if (fd && ::listen(fd.value(), 4) != 0) fd.reset();
  return fd;
}

class TcpTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(connection_.ours && connection_.theirs); }
  Received read(Duration patience = 5s) {
    return connection_.ours->read(buffer_, now() + patience);
  }
  void send(std::string_view text) const {
    ASSERT_EQ(::send(connection_.theirs.value(), text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
  }

  UniqueFd listener_ = listening_socket();
  Connection connection_ = Connection::to(listener_, "127.0.0.1");
  std::array<std::byte, Transport::kLargestMessage> buffer_{};
};

TEST_F(TcpTest, BytesComeInOrderAndGoOut) {
  std::string sent;
  for (int i = 0; i < 10000; ++i) sent += static_cast<char>(i * 7);
  send(sent);
  std::string got;
  while (got.size() < sent.size()) {
    const Time before = now();
    const Received received = read();
    ASSERT_EQ(received.status, IoStatus::kOk);
    EXPECT_GE(received.arrival, before);
    EXPECT_LE(received.arrival, now());
    got.append(reinterpret_cast<const char*>(buffer_.data()), received.bytes);
  }
  EXPECT_EQ(got, sent);

  ASSERT_EQ(connection_.ours->write(loopback::bytes_of("answer"), now() + 5s), IoStatus::kOk);
  std::array<char, 6> answer{};
  ASSERT_EQ(::recv(connection_.theirs.value(), answer.data(), answer.size(), MSG_WAITALL), 6);
  EXPECT_EQ(std::string(answer.data(), answer.size()), "answer");
}

TEST_F(TcpTest, WaitsForTheDeadlineWithoutSpinning) {
  const std::clock_t cpu = std::clock();
  const Time start = now();
  EXPECT_EQ(read(60ms).status, IoStatus::kTimeout);
  EXPECT_GE(now() - start, 60ms);
  EXPECT_LT(static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC, 0.03);
  send("x");
  EXPECT_EQ(read().status, IoStatus::kOk);  // a timeout is not the end
}

TEST_F(TcpTest, APeerThatClosedIsGoneAfterItsLastBytes) {
  send("last");
  connection_.theirs.reset();
  EXPECT_EQ(read().bytes, 4U);
  EXPECT_EQ(read().status, IoStatus::kGone);
  EXPECT_EQ(read(0s).status, IoStatus::kGone);
}

TEST_F(TcpTest, APeerThatDiedIsGone) {
  const linger at_once{1, 0};  // closing sends a reset
  ::setsockopt(connection_.theirs.value(), SOL_SOCKET, SO_LINGER, &at_once, sizeof(at_once));
  connection_.theirs.reset();
  EXPECT_EQ(read().status, IoStatus::kGone);
  EXPECT_EQ(connection_.ours->write(loopback::bytes_of("x"), now()), IoStatus::kGone);
}

TEST_F(TcpTest, APeerThatDoesNotReadHoldsNobodyBeyondTheDeadline) {
  const std::vector<std::byte> much(64U << 20U);
  const Time start = now();
  EXPECT_EQ(connection_.ours->write(much, start + 50ms), IoStatus::kIo);  // a part went out
  // The system may find some more room; when there is none left, nothing goes out.
  IoStatus status = IoStatus::kIo;
  for (int i = 0; i < 50 && status == IoStatus::kIo; ++i)
    status = connection_.ours->write(much, now() + 20ms);
  EXPECT_EQ(status, IoStatus::kTimeout);
  EXPECT_LT(now() - start, 5s);
}

TEST(TcpPort, NobodyThereIsNotFoundAndFoundOnceThere) {
  SteadyClock clock;
  const int number = loopback::free_port(SOCK_STREAM);
  TcpPort port("127.0.0.1", number, clock);
  const auto refused = port.open();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kNotFound);
  EXPECT_THAT(refused.error().what, testing::HasSubstr("is the server running?"));
  const UniqueFd listener = listening_socket(number);
  ASSERT_TRUE(listener);
  EXPECT_TRUE(port.open());
}

TEST(TcpPort, ReachesEitherFamily) {
  for (const auto& [family, host] :
       {std::pair{AF_INET, "127.0.0.1"}, {AF_INET6, "::1"}, {AF_INET, "localhost"}}) {
    const UniqueFd listener = listening_socket(0, family);
    if (!listener) continue;  // a machine without IPv6
    EXPECT_TRUE(Connection::to(listener, host).ours) << host;
  }
}

TEST(TcpPort, AServerThatDoesNotAnswerHoldsNobody) {
  SteadyClock clock;
  // A queue of connections that is full leaves the next one without an answer.
  UniqueFd listener = loopback::bound_socket(SOCK_STREAM);
  ASSERT_EQ(::listen(listener.value(), 0), 0);
  std::vector<std::unique_ptr<TcpPort>> ports;
  std::vector<std::unique_ptr<Transport>> open;
  Errc last = Errc::kIo;
  for (int i = 0; i < 16 && last != Errc::kNotFound; ++i) {
    ports.push_back(std::make_unique<TcpPort>("127.0.0.1", loopback::port_of(listener), clock));
    const Time start = now();
    auto opened = ports.back()->open();
    EXPECT_LT(now() - start, 2s);  // meant are 50 ms; the machine may be busy
    if (opened) {
      open.push_back(*std::move(opened));
    } else {
      last = opened.error().code;
      EXPECT_THAT(opened.error().what, testing::HasSubstr("no answer so far"));
    }
  }
  ASSERT_EQ(last, Errc::kNotFound) << "the queue never filled";
  // The attempt goes on behind: with room in the queue, it is made.
  for (std::size_t i = 0; i < open.size(); ++i)
    UniqueFd(::accept(listener.value(), nullptr, nullptr)).reset();
  const Time start = now();
  while (now() - start < 10s && last == Errc::kNotFound) {
    if (ports.back()->open()) last = Errc::kIo;
  }
  EXPECT_NE(last, Errc::kNotFound);
}

TEST(TcpPort, AnUnknownNameIsNotFound) {
  SteadyClock clock;
  const auto opened = TcpPort("host.invalid", 3883, clock).open();  // RFC 2606: never exists
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, Errc::kNotFound);
  EXPECT_THAT(opened.error().what, testing::HasSubstr("check the name"));
}

TEST(TcpPort, WaitsOnItsClockAlone) {
  VirtualClock clock;
  EXPECT_FALSE(TcpPort("127.0.0.1", 1, clock).wait_for_arrival(Time{1h}));
  EXPECT_EQ(clock.now(), Time{1h});
}

}  // namespace
}  // namespace veneer::tracking
