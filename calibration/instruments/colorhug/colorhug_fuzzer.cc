// SPDX-License-Identifier: Apache-2.0
#include "base/testing/fuzzing.h"
#include "calibration/instruments/colorhug/colorhug_protocol.h"

namespace veneer::calibration {
namespace {

/// Replies of any length: a failure has a text, and a reading is a number within its range.
Verdict read(std::string_view text) {
  using namespace colorhug;
  const std::span<const std::byte> reply = std::as_bytes(std::span(text.data(), text.size()));
  for (const Command command :
       {Command::kFirmwareVersion, Command::kSerialNumber, Command::kTakeReadingXyz})
    if (kind_of(reply, command) == ReplyKind::kFailed && failure_of(reply).what.empty())
      return accepted("a failure without a text");
  const auto xyz = reading_xyz(reply);
  if (xyz && !(xyz->allFinite() && xyz->cwiseAbs().maxCoeff() <= 32768))
    return accepted("a reading is out of range");
  const auto version = firmware_version(reply);
  if (version && (version->major < 0 || version->minor < 0 || version->micro < 0))
    return accepted("a version is negative");
  if (xyz || version || serial_number(reply)) return accepted();
  return refused("none of the replies");
}

}  // namespace
}  // namespace veneer::calibration

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace calibration;
  using namespace std::string_literals;
  static const FuzzedReader kReader{&read,
                                    {"\0\x23\0\x80\x23\0\0\0\x28\0\0\x40\x10\0"s,
                                     "\0\x07\x02\0\0\0\x07\0"s,
                                     "\0\x0B\x39\x30\0\0"s},
                                    {512, 4},
                                    {"\x12\x23"s}};
  return kReader;
}
