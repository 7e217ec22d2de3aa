// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/fastrak_protocol.h"
#include "tracking/testing/protocol_fuzzer.h"

namespace veneer::tracking {
namespace {

std::vector<std::byte> record(int station) {
  FastrakRecord record;
  record.station = station;
  const auto bytes = encode(record);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

const FuzzedProtocol& fuzzed_protocol() {
  static const FuzzedProtocol kFastrak{Framing::kStream,
                                       [] { return std::make_unique<FastrakProtocol>(); },
                                       {{record(1), record(4), record(1)}}};
  return kFastrak;
}

}  // namespace veneer::tracking
