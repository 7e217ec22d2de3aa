// SPDX-License-Identifier: Apache-2.0
#include "tracking/testing/protocol_laws.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace veneer::tracking {
namespace {

using Pieces = std::span<const std::span<const std::byte>>;

template <class T>
bool same_bits(const T& a, const T& b) {
  return std::memcmp(a.data(), b.data(), sizeof(T)) == 0;
}

std::string difference(const Understanding& a, const Understanding& b) {
  if (!std::ranges::equal(a.samples, b.samples, identical)) {
    return fmt::format("other samples: {} and {}", a.samples.size(), b.samples.size());
  }
  if (a.reply != b.reply) return "other answers";
  if (a.counters.bad_frames != b.counters.bad_frames ||
      a.counters.skipped_bytes != b.counters.skipped_bytes) {
    return fmt::format("other counters: {} and {} bad frames, {} and {} bytes skipped",
                       a.counters.bad_frames,
                       b.counters.bad_frames,
                       a.counters.skipped_bytes,
                       b.counters.skipped_bytes);
  }
  if (a.wants_restart != b.wants_restart) return "another wish for a restart";
  return {};
}

/// @param size    of all that came.
/// @param pieces  messages that came; an empty one may be a bad frame as well. 0 for a stream.
std::string broken_bound(const Protocol& protocol,
                         const Understanding& got,
                         std::size_t size,
                         std::size_t pieces) {
  if (got.counters.skipped_bytes > size) return "more skipped than came";
  if (got.counters.bad_frames > size + pieces) return "more bad frames than came";
  if (got.samples.size() > size) return "more samples than bytes";
  if (got.reply.size() > size) return "more answered than asked";
  const bool ticks = protocol.clock().has_value();
  const bool numbers = protocol.sequence().has_value();
  for (const RawSample& sample : got.samples) {
    if (sample.ticks.has_value() != ticks) return "ticks where there is no clock, or none";
    if (sample.sequence.has_value() != numbers) return "sequence numbers against sequence()";
  }
  return {};
}

/// After reset(), the same input once more.
std::string broken_by_reset(Protocol& protocol, Pieces pieces, const Understanding& first) {
  protocol.reset();
  if (protocol.wants_restart()) return "reset() leaves the wish for a restart";
  const ProtocolCounters kept = protocol.counters();
  if (kept.bad_frames != first.counters.bad_frames ||
      kept.skipped_bytes != first.counters.skipped_bytes) {
    return "reset() changes the counters";
  }
  Understanding again = understand(protocol, pieces);
  if (again.counters.bad_frames < kept.bad_frames ||
      again.counters.skipped_bytes < kept.skipped_bytes) {
    return "a counter has shrunk";
  }
  again.counters.bad_frames -= kept.bad_frames;
  again.counters.skipped_bytes -= kept.skipped_bytes;
  const std::string found = difference(first, again);
  return found.empty() ? found : "after reset(): " + found;
}

}  // namespace

Understanding understand(Protocol& protocol, Pieces pieces) {
  Understanding result;
  for (const std::span<const std::byte> piece : pieces)
    protocol.feed(piece, result.samples, result.reply);
  result.counters = protocol.counters();
  result.wants_restart = protocol.wants_restart();
  return result;
}

bool identical(const RawSample& a, const RawSample& b) {
  return a.sensor == b.sensor && a.ticks == b.ticks && a.sequence == b.sequence &&
         a.suspect == b.suspect && same_bits(a.position_m, b.position_m) &&
         same_bits(a.rotation.coeffs(), b.rotation.coeffs());
}

std::string broken_law(const MakeProtocol& make, Framing framing, Pieces pieces, std::size_t cut) {
  std::vector<std::byte> all;
  for (const std::span<const std::byte> piece : pieces)
    all.insert(all.end(), piece.begin(), piece.end());
  const std::vector<std::span<const std::byte>> whole{all};
  const bool stream = framing == Framing::kStream;

  const std::unique_ptr<Protocol> protocol = make();
  const Understanding first = understand(*protocol, stream ? whole : pieces);
  std::string law = broken_bound(*protocol, first, all.size(), stream ? 0 : pieces.size());
  if (!law.empty()) return law;
  if (stream) {
    const std::size_t at = all.empty() ? 0 : cut % all.size();
    const std::vector<std::span<const std::byte>> halves{std::span(all).first(at),
                                                         std::span(all).subspan(at)};
    const std::string found = difference(first, understand(*make(), halves));
    if (!found.empty()) return fmt::format("cut at {}: {}", at, found);
  }
  return broken_by_reset(*protocol, stream ? whole : pieces, first);
}

}  // namespace veneer::tracking
