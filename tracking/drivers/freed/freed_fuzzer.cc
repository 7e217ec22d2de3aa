// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/freed/freed_protocol.h"
#include "tracking/testing/freed_writer.h"
#include "tracking/testing/protocol_fuzzer.h"

namespace veneer::tracking {

const FuzzedProtocol& fuzzed_protocol() {
  static const FuzzedProtocol kFreed{
      Framing::kMessages,
      [] { return std::make_unique<FreedProtocol>(FreedProtocol::Up::kY, 50.0); },
      {{freed::Message{1, -12.5, 3.25, 179.999, {-1234.5, 0.015625, 131071.98}, 1, 2, 3}.bytes(),
        freed::Message{2}.bytes()}}};
  return kFreed;
}

}  // namespace veneer::tracking
