// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tracking/device/protocol.h"

namespace veneer::tracking {

/// How bytes come to a protocol.
enum class Framing {
  kStream,    ///< cut anywhere
  kMessages,  ///< USB HID reports or datagrams: whole
};

using MakeProtocol = std::function<std::unique_ptr<Protocol>()>;

/// What a protocol makes of some input.
struct Understanding {
  std::vector<RawSample> samples;
  std::vector<std::byte> reply;
  ProtocolCounters counters;
  bool wants_restart = false;
};

/// Feeds the pieces one after the other.
[[nodiscard]] Understanding understand(Protocol& protocol,
                                       std::span<const std::span<const std::byte>> pieces);

/// Whether two samples are the same bit for bit, NaN included.
[[nodiscard]] bool identical(const RawSample& a, const RawSample& b);

/// Checks what holds for every protocol and any input, and returns the law that was broken; nothing
/// where all hold:
/// - a stream cut in two gives what it gives whole (samples, answers, counters, the wish for a
///   restart);
/// - after reset() a protocol is as new but for its counters, which only grow;
/// - there is no more skipped than came, and no more samples or answers than bytes;
/// - sequence numbers and ticks are there if and only if sequence() and clock() say so.
/// @param pieces  what comes, in order; for a stream they are taken as one.
/// @param cut     where a stream is cut, for the first law; taken modulo its length.
[[nodiscard]] std::string broken_law(const MakeProtocol& make,
                                     Framing framing,
                                     std::span<const std::span<const std::byte>> pieces,
                                     std::size_t cut);

}  // namespace veneer::tracking
