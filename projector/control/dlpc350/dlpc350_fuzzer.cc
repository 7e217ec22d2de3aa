// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <span>

#include "base/testing/law.h"
#include "projector/control/dlpc350/dlpc350_protocol.h"

using namespace veneer;
using namespace veneer::projector;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

/// Reports, each a byte for its length and its bytes, to a reader of a reply; the first byte of all
/// is the sequence number that is waited for.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using Step = dlpc350::ReplyReader::Step;
  std::span<const std::byte> input = std::as_bytes(std::span(data, size));
  if (input.empty()) return 0;
  dlpc350::ReplyReader reader(std::to_integer<std::uint8_t>(input[0]), true);
  input = input.subspan(1);
  while (!input.empty()) {
    const std::size_t wanted = std::to_integer<std::size_t>(input[0]) % 80;
    input = input.subspan(1);
    const std::size_t length = std::min(wanted, input.size());
    const Step step = reader.add(input.first(length));
    input = input.subspan(length);
    law(reader.data().size() <= dlpc350::kLongestReply, "a reply longer than any");
    if (step == Step::kMore || step == Step::kStray) continue;
    if (step != Step::kDone) return 0;
    has_text(dlpc350::read_version(reader.data()));
    has_text(dlpc350::read_byte(reader.data()));
    has_text(dlpc350::read_lock(reader.data()));
    for (const bool inverted : {false, true}) {
      const auto levels = dlpc350::read_led_levels(reader.data(), inverted);
      has_text(levels);
      if (levels)
        law(dlpc350::led_parameters(*levels, inverted).has_value(), "levels that cannot be set");
    }
    return 0;
  }
  return 0;
}
