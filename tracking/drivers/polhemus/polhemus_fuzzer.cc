// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/polhemus_protocol.h"
#include "tracking/testing/protocol_fuzzer.h"

namespace veneer::tracking {
namespace {

std::vector<std::byte> frame(std::uint8_t station) {
  PolhemusFrame frame;
  frame.station = station;
  frame.count = 240;
  const auto bytes = encode(frame, PolhemusModel::kLiberty);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

const FuzzedProtocol& fuzzed_protocol() {
  static const FuzzedProtocol kPolhemus{
      Framing::kStream,
      [] { return std::make_unique<PolhemusProtocol>(PolhemusModel::kLiberty); },
      {{frame(1), frame(2), frame(1)}}};
  return kPolhemus;
}

}  // namespace veneer::tracking
