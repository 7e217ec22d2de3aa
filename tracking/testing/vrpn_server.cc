// SPDX-License-Identifier: Apache-2.0
#include "tracking/testing/vrpn_server.h"

#include <poll.h>

#include <chrono>

#include "tracking/testing/loopback.h"

namespace veneer::tracking::vrpn {
namespace {

using namespace std::chrono_literals;

constexpr int kPosePeriod_ms = 5;

std::uint32_t number_at(const Bytes& bytes, std::size_t offset) {
  std::uint32_t value = 0;
  for (std::size_t i = offset; i < offset + 4; ++i)
    value = value << 8U | std::to_integer<std::uint32_t>(bytes.at(i));
  return value;
}

Stamp stamp_of(std::chrono::system_clock::duration time) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(time);
  const auto rest = std::chrono::duration_cast<std::chrono::microseconds>(time - seconds);
  return {static_cast<std::int32_t>(seconds.count()), static_cast<std::int32_t>(rest.count())};
}

}  // namespace

Server::Server(const Options& options)
    : options_(options),
      listener_(loopback::bound_socket(SOCK_STREAM, options.port)),
      sends_poses_(options.sends_poses) {
  ::listen(listener_.value(), 4);
  port_ = loopback::port_of(listener_);
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

std::string Server::complaint() const {
  const std::scoped_lock lock(mutex_);
  return complaint_;
}

void Server::complain(const std::string& text) {
  const std::scoped_lock lock(mutex_);
  complaint_ += text + "; ";
}

void Server::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    pollfd entry{listener_.value(), POLLIN, 0};
    if (::poll(&entry, 1, 20) != 1) continue;
    const UniqueFd client(::accept(listener_.value(), nullptr, nullptr));
    if (!client) continue;
    ++connections_;
    serve(client, stop);
  }
}

void Server::send(const UniqueFd& fd, const Bytes& bytes) {
  // In two pieces, as a network may do.
  const std::size_t half = bytes.size() / 2;
  ::send(fd.value(), bytes.data(), half, MSG_NOSIGNAL);
  ::send(fd.value(), bytes.data() + half, bytes.size() - half, MSG_NOSIGNAL);
}

void Server::serve(const UniqueFd& fd, const std::stop_token& stop) {
  Client client;
  bool described = false;
  int count = 0;
  send(fd, cookie(options_.version));
  while (!stop.stop_requested()) {
    pollfd entry{fd.value(), POLLIN, 0};
    if (::poll(&entry, 1, kPosePeriod_ms) == 1 && !hear(fd, client)) return;
    if (!client.greeted) continue;
    if (!described) {
      Bytes names = greeting("Tracker0");
      names.erase(names.begin(), names.begin() + 24);  // the cookie is out
      send(fd, names);
      described = true;
    }
    if (ping_wanted_.exchange(false)) send(fd, message(kTracker, kPing, {}));
    if (sends_poses_) {
      const auto now =
          std::chrono::system_clock::now().time_since_epoch() + std::chrono::seconds(clock_step_s_);
      const Pose pose{1, {1e-3 * ++count, 2, 3}, {0, 0, 1, 0}};
      send(fd, pose_message(kTracker, vrpn::kPose, pose, stamp_of(now)));
    }
  }
}

bool Server::hear(const UniqueFd& fd, Client& client) {
  Bytes buffer(4096);
  const ssize_t count = ::recv(fd.value(), buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (count <= 0) return false;
  client.pending.insert(client.pending.end(), buffer.begin(), buffer.begin() + count);
  while (true) {
    Bytes& pending = client.pending;
    std::size_t size = 24;
    if (client.greeted) {
      if (pending.size() < 24) return true;
      size = (number_at(pending, 0) + 7) / 8 * 8;
      if (size < 24 || size > 64000) {
        complain("a message of an impossible length");
        return false;
      }
    }
    if (pending.size() < size) return true;
    const auto end = pending.begin() + static_cast<std::ptrdiff_t>(size);
    take(client, fd, Bytes(pending.begin(), end));
    pending.erase(pending.begin(), end);
  }
}

void Server::take(Client& client, const UniqueFd& fd, const Bytes& bytes) {
  if (!client.greeted) {
    std::string text;
    for (std::size_t i = 0; i < 14; ++i) text += static_cast<char>(bytes[i]);
    if (text != "vrpn: ver. 07.") complain("a greeting that is none: " + text);
    client.greeted = true;
    return;
  }
  const auto sender = static_cast<std::int32_t>(number_at(bytes, 12));
  const auto type = static_cast<std::int32_t>(number_at(bytes, 16));
  if (type == kSenderDescription || type == kTypeDescription) {
    const std::uint32_t size = number_at(bytes, 24);
    if (number_at(bytes, 0) != 28 + size || bytes.at(27 + size) != std::byte{0})
      complain("a description of the wrong size");
    std::string name;
    for (std::size_t i = 0; i + 1 < size; ++i) name += static_cast<char>(bytes.at(28 + i));
    if (name == "Tracker0") client.tracker = sender;
    if (name == "vrpn_Base ping_message") client.ping = sender;
    if (name == "vrpn_Base pong_message") client.pong = sender;
  } else if (type == -3) {
    complain("it wants UDP");
  } else if (type == client.ping && sender == client.tracker) {
    ++pings_;
    // Without a description of its own nobody would know what it is, so it is an answer of a type
    // that the client passes over: it is there, that is all it says.
    send(fd, message(kTracker, 9, {}));
  } else if (type == client.pong && sender == client.tracker) {
    ++pongs_;
  } else {
    complain("a message of an unknown sender or type");
  }
}

}  // namespace veneer::tracking::vrpn
