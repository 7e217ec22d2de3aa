// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/result.h"
#include "capture/polarisers/elliptec/protocol.h"

/// A line from the stage. A position that is understood is sent as the same digits.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace veneer::capture::elliptec;
  const auto reply = parse_reply({reinterpret_cast<const char*>(data), size});
  if (!reply) return 0;
  (void)parse_information(*reply);
  if (const auto status = parse_status(*reply)) VENEER_CHECK(!text_of_status(*status).empty());
  if (const auto position = parse_position(*reply))
    VENEER_CHECK(move_request(reply->address, *position).substr(3) == reply->data);
  return 0;
}
