// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/osvr_hdk/osvr_hdk_protocol.h"
#include "tracking/testing/protocol_fuzzer.h"

namespace veneer::tracking {
namespace {

std::vector<std::byte> report(std::uint8_t version, std::uint8_t sequence, std::size_t size) {
  std::vector<std::byte> bytes(size);
  bytes[0] = std::byte{version};
  bytes[1] = std::byte{sequence};
  bytes[9] = std::byte{0x40};  // w = 1
  return bytes;
}

}  // namespace

const FuzzedProtocol& fuzzed_protocol() {
  static const FuzzedProtocol kHdk{Framing::kMessages,
                                   [] { return std::make_unique<OsvrHdkProtocol>(); },
                                   {{report(1, 254, 16), report(2, 255, 32), report(3, 0, 32)}}};
  return kHdk;
}

}  // namespace veneer::tracking
