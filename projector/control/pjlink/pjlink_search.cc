// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/pjlink_search.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>

#include "base/unique_handle.h"
#include "projector/control/pjlink/pjlink_protocol.h"

namespace veneer::projector::pjlink {
namespace {

constexpr std::string_view kDoing = "searching for projectors";
constexpr Duration kLongestWait = std::chrono::minutes(1);
/// Whoever answers more often than any network has projectors is not listened to.
constexpr std::size_t kMostProjectors = 1024;

Result<UniqueFd> open_socket(int port) {
  UniqueFd fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  if (!fd || ::setsockopt(fd.value(), SOL_SOCKET, SO_BROADCAST, &on, sizeof(on)) != 0)
    return fail(Errc::kIo, "{}: {}", kDoing, std::strerror(errno));
  // Answers may come to the port that was asked or to the one that asked; one socket on both is
  // sure to hear them. Where another program has the port, the second kind is still heard.
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  static_cast<void>(
      ::bind(fd.value(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)));
  return fd;
}

}  // namespace

Status SearchOptions::check() const {
  in_addr parsed{};
  if (::inet_pton(AF_INET, address.c_str(), &parsed) != 1)
    return fail(Errc::kInvalidOption,
                "{}: \"{}\" is no IPv4 address; write one in numbers, as 192.0.2.255",
                kDoing,
                readable(address));
  if (port < 1 || port > 65535)
    return fail(Errc::kInvalidOption, "{}: port is {}; set it from 1 to 65535", kDoing, port);
  if (wait <= Duration{0} || wait > kLongestWait)
    return fail(Errc::kInvalidOption, "{}: wait above 0 s, and 60 s at most", kDoing);
  return {};
}

Result<std::vector<FoundProjector>> search(const SearchOptions& options) {
  VENEER_TRY(options.check());
  VENEER_ASSIGN(const UniqueFd fd, open_socket(options.port));
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(options.port));
  ::inet_pton(AF_INET, options.address.c_str(), &to.sin_addr);
  constexpr std::string_view kQuestion = "%2SRCH\r";
  if (::sendto(fd.value(),
               kQuestion.data(),
               kQuestion.size(),
               MSG_NOSIGNAL,
               reinterpret_cast<const sockaddr*>(&to),
               sizeof(to)) < 0)
    return fail(Errc::kUnavailable,
                "{}: nothing can be sent to {}: {}; see to the network, or name its broadcast "
                "address",
                kDoing,
                options.address,
                std::strerror(errno));
  std::map<std::string, FoundProjector> found;
  SteadyClock clock;
  const Time end = clock.now() + options.wait;
  while (found.size() < kMostProjectors) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - clock.now());
    if (left.count() <= 0) break;
    pollfd entry{fd.value(), POLLIN, 0};
    if (::poll(&entry, 1, static_cast<int>(left.count())) <= 0) continue;
    std::array<char, kLongestLine> buffer{};
    sockaddr_in from{};
    socklen_t size = sizeof(from);
    const ssize_t count = ::recvfrom(
        fd.value(), buffer.data(), buffer.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
    if (count < 0) continue;  // as where one of several refused
    // Our own question comes back from a broadcast, and others may send anything.
    const auto mac = read_acknowledgement({buffer.data(), static_cast<std::size_t>(count)});
    if (!mac) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    ::inet_ntop(AF_INET, &from.sin_addr, text.data(), text.size());
    found[text.data()] = {text.data(), *mac};
  }
  std::vector<FoundProjector> result;
  for (auto& [address, projector] : found) result.push_back(std::move(projector));
  std::ranges::sort(result, {}, [](const FoundProjector& each) {
    return ntohl(::inet_addr(each.address.c_str()));
  });
  return result;
}

}  // namespace veneer::projector::pjlink
