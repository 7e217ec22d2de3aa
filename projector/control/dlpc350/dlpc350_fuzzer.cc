// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <span>

#include "base/testing/fuzzing.h"
#include "base/testing/law.h"
#include "projector/control/dlpc350/dlpc350_protocol.h"

namespace veneer::projector {
namespace {

/// Reports, each a byte for its length and its bytes, to a reader of a reply; the first byte of all
/// is the sequence number that is waited for.
Verdict read(std::string_view text) {
  using Step = dlpc350::ReplyReader::Step;
  std::span<const std::byte> input = std::as_bytes(std::span(text));
  if (input.empty()) return refused("nothing");
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
    if (step != Step::kDone) return refused("a refusal or nonsense");
    has_text(dlpc350::read_version(reader.data()));
    has_text(dlpc350::read_byte(reader.data()));
    has_text(dlpc350::read_lock(reader.data()));
    for (const bool inverted : {false, true}) {
      const auto levels = dlpc350::read_led_levels(reader.data(), inverted);
      has_text(levels);
      if (levels)
        law(dlpc350::led_parameters(*levels, inverted).has_value(), "levels that cannot be set");
    }
    return accepted();
  }
  return refused("half a reply");
}

/// A reply of as many bytes, to the request 5.
std::string reply(std::size_t size) {
  std::string message("\xC0\x05\0\0", 4);
  message[2] = static_cast<char>(size & 0xFFU);
  message[3] = static_cast<char>(size >> 8U);
  for (std::size_t i = 0; i < size; ++i) message += static_cast<char>(i * 7);
  std::string text = "\x05";
  for (std::size_t at = 0; at < message.size(); at += dlpc350::kReportSize) {
    std::string report = message.substr(at, dlpc350::kReportSize);
    report.resize(dlpc350::kReportSize);
    text += static_cast<char>(dlpc350::kReportSize) + report;
  }
  return text;
}

}  // namespace
}  // namespace veneer::projector

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace projector;
  static const FuzzedReader kReader{
      &read,
      {reply(1), reply(3), reply(16), reply(28), reply(dlpc350::kLongestReply)},
      {256, 6},
      {reply(dlpc350::kLongestReply + 1)}};
  return kReader;
}
