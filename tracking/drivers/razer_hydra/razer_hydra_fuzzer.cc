// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/razer_hydra/razer_hydra_protocol.h"
#include "tracking/testing/protocol_fuzzer.h"

namespace veneer::tracking {
namespace {

/// Both controllers, 0.1 m to one side of the base.
std::vector<std::byte> report() {
  std::vector<std::byte> bytes(RazerHydraProtocol::kReportBytes);
  for (const std::size_t block : {std::size_t{8}, std::size_t{30}}) {
    bytes[block] = std::byte{100};
    bytes[block + 7] = std::byte{0x7F};  // w
  }
  return bytes;
}

}  // namespace

const FuzzedProtocol& fuzzed_protocol() {
  static const FuzzedProtocol kHydra{
      Framing::kMessages,
      // With a hemisphere, which is the longer way.
      [] { return std::make_unique<RazerHydraProtocol>(Eigen::Vector3d::UnitZ()); },
      {{report(), std::vector<std::byte>(16), report()}}};
  return kHydra;
}

}  // namespace veneer::tracking
