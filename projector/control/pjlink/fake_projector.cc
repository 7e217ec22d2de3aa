// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/fake_projector.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <utility>

#include "base/result.h"

namespace veneer::projector::pjlink {
namespace {

constexpr int kPoll_ms = 5;

bool is_readable(int fd) {
  pollfd entry{fd, POLLIN, 0};
  return ::poll(&entry, 1, kPoll_ms) > 0;
}

}  // namespace

FakeProjector::Behaviour FakeProjector::well() {
  Behaviour behaviour;
  behaviour.replies = {{"%1CLSS ?\r", "%1CLSS=2\r"},
                       {"%1POWR ?\r", "%1POWR=1\r"},
                       {"%2INPT ?\r", "%2INPT=31\r"},
                       {"%1AVMT ?\r", "%1AVMT=30\r"},
                       {"%1ERST ?\r", "%1ERST=000000\r"},
                       {"%1LAMP ?\r", "%1LAMP=1234 1\r"},
                       {"%1INF1 ?\r", "%1INF1=Maker\r"},
                       {"%1INF2 ?\r", "%1INF2=Model\r"},
                       {"%1NAME ?\r", "%1NAME=Hall 3\r"},
                       {"%2FREZ ?\r", "%2FREZ=0\r"},
                       {"%2SNUM ?\r", "%2SNUM=S123\r"},
                       {"%2SVER ?\r", "%2SVER=1.02\r"}};
  return behaviour;
}

FakeProjector::FakeProjector(Behaviour behaviour, int port) : behaviour_(std::move(behaviour)) {
  listener_ = UniqueFd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  const int on = 1;  // the port may be that of one that is just gone
  VENEER_CHECK(::setsockopt(listener_.value(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) == 0);
  socklen_t size = sizeof(address);
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  VENEER_CHECK(::bind(listener_.value(), generic, size) == 0);
  VENEER_CHECK(::listen(listener_.value(), 8) == 0);
  VENEER_CHECK(::getsockname(listener_.value(), generic, &size) == 0);
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { serve(); });
}

FakeProjector::~FakeProjector() {
  stopping_ = true;
  thread_.join();
}

void FakeProjector::reply(const std::string& request, const std::string& reply) {
  const std::lock_guard lock(mutex_);
  behaviour_.replies[request] = reply;
}

void FakeProjector::greet(const std::string& greeting) {
  const std::lock_guard lock(mutex_);
  behaviour_.greeting = greeting;
}

std::vector<std::string> FakeProjector::conversations() const {
  const std::lock_guard lock(mutex_);
  return conversations_;
}

void FakeProjector::wait_for_end() const {
  while (busy_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

void FakeProjector::serve() {
  while (!stopping_) {
    if (!is_readable(listener_.value())) continue;
    const UniqueFd fd(::accept4(listener_.value(), nullptr, nullptr, SOCK_CLOEXEC));
    if (!fd) continue;
    busy_ = true;
    converse(fd.value());
    busy_ = false;
  }
}

bool FakeProjector::send_slowly(int fd, const std::string& text) {
  std::chrono::milliseconds delay{};
  std::chrono::milliseconds byte_delay{};
  {
    const std::lock_guard lock(mutex_);
    delay = behaviour_.delay;
    byte_delay = behaviour_.byte_delay;
  }
  std::this_thread::sleep_for(delay);
  const std::size_t piece = byte_delay.count() > 0 ? 1 : text.size();
  for (std::size_t i = 0; i < text.size() && !stopping_; i += piece) {
    if (::send(fd, text.data() + i, piece, MSG_NOSIGNAL) < 0) return false;
    std::this_thread::sleep_for(byte_delay);
  }
  return true;
}

void FakeProjector::converse(int fd) {
  std::string greeting;
  {
    const std::lock_guard lock(mutex_);
    conversations_.emplace_back();
    greeting = behaviour_.greeting;
  }
  if (!send_slowly(fd, greeting)) return;
  std::string received;
  int replies = 0;
  while (!stopping_) {
    if (!is_readable(fd)) continue;
    std::array<char, 256> buffer{};
    const ssize_t count = ::recv(fd, buffer.data(), buffer.size(), 0);
    if (count <= 0) return;
    received.append(buffer.data(), static_cast<std::size_t>(count));
    std::string request;
    std::string reply;
    int replies_a_connection = 0;
    {
      const std::lock_guard lock(mutex_);
      conversations_.back().append(buffer.data(), static_cast<std::size_t>(count));
      const std::size_t end = received.find('\r');
      if (end == std::string::npos) continue;
      request = received.substr(0, end + 1);
      received.erase(0, end + 1);
      const auto known = behaviour_.replies.find(request);
      // Behind a digest it is the same request.
      reply = known != behaviour_.replies.end() ? known->second : request.substr(0, 6) + "=ERR1\r";
      if (request.size() > 32 && request[32] == '%') {
        const auto inner = behaviour_.replies.find(request.substr(32));
        reply =
            inner != behaviour_.replies.end() ? inner->second : request.substr(32, 6) + "=ERR1\r";
        if (known != behaviour_.replies.end()) reply = known->second;
      }
      replies_a_connection = behaviour_.replies_a_connection;
    }
    if (reply.empty()) return;
    if (reply != "..." && !send_slowly(fd, reply)) return;
    if (++replies == replies_a_connection) return;
  }
}

}  // namespace veneer::projector::pjlink
