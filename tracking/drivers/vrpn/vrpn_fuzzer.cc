// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/vrpn/vrpn_protocol.h"
#include "tracking/testing/protocol_fuzzer.h"
#include "tracking/testing/vrpn_writer.h"

namespace veneer::tracking {

const FuzzedProtocol& fuzzed_protocol() {
  static const FuzzedProtocol kVrpn{
      Framing::kStream,
      [] { return std::make_unique<VrpnProtocol>("T", 100.0); },
      {{vrpn::greeting("T"),
        vrpn::pose_message(vrpn::kTracker, vrpn::kPose, {1, {1, 2, 3}, {0, 0, 0, 1}}, {5, 6}),
        vrpn::message(vrpn::kTracker, vrpn::kPing, {})}}};
  return kVrpn;
}

}  // namespace veneer::tracking
