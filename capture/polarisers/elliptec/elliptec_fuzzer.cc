// SPDX-License-Identifier: Apache-2.0
#include <string_view>

#include "base/result.h"
#include "base/testing/fuzzing.h"
#include "capture/polarisers/elliptec/protocol.h"

namespace veneer::capture::elliptec {
namespace {

/// A line from the stage. A position that is understood is sent as the same digits.
Verdict read(std::string_view line) {
  const auto reply = parse_reply(line);
  if (!reply) return refused(reply.error());
  (void)parse_information(*reply);
  if (const auto status = parse_status(*reply)) VENEER_CHECK(!text_of_status(*status).empty());
  if (const auto position = parse_position(*reply))
    VENEER_CHECK(move_request(reply->address, *position).substr(3) == reply->data);
  return accepted();
}

}  // namespace
}  // namespace veneer::capture::elliptec

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace capture::elliptec;
  static const FuzzedReader kReader{
      &read,
      {"0IN0E1140051720231701016800023000", "0GS00", "0GS0B", "0PO00008C00", "APOFFFFFFFF"},
      {384, 8}};
  return kReader;
}
