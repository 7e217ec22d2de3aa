// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisers/elliptec/protocol.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

namespace veneer::capture::elliptec {
namespace {

bool is_hex(char c) { return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'F'); }

std::optional<std::uint32_t> number(std::string_view digits) {
  std::uint32_t value = 0;
  const auto [stop, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  if (error != std::errc() || stop != digits.data() + digits.size()) return std::nullopt;
  return value;
}

std::string printable(std::string_view bytes) {
  std::string text;
  for (const char c : bytes.substr(0, 60))
    text += c >= ' ' && c <= '~' ? std::string(1, c)
                                 : fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
  return text;
}

auto not_understood(const Reply& reply) {
  return fail(Errc::kBadFormat,
              "the stage answered \"{}{}\", which is not understood",
              reply.command,
              printable(reply.data));
}

}  // namespace

Result<Reply> parse_reply(std::string_view line) {
  const auto is_letter = [](char c) { return c >= 'A' && c <= 'Z'; };
  if (line.size() < 3 || !is_hex(line[0]) || !is_letter(line[1]) || !is_letter(line[2]) ||
      !std::ranges::all_of(line.substr(3), is_hex))
    return fail(Errc::kBadFormat, "no answer of a stage: \"{}\"", printable(line));
  return Reply{line[0], std::string(line.substr(1, 2)), std::string(line.substr(3))};
}

bool Information::is_rotation_stage() const {
  static constexpr std::array kRotating{8, 14, 16, 18, 21, 22};
  return std::ranges::count(kRotating, type) > 0 && pulses_per_revolution > 0;
}

Result<Information> parse_information(const Reply& reply) {
  // Type 2 digits, serial number 8, year 4, firmware 2, hardware 2, travel 4, pulses 8.
  constexpr std::size_t kLength = 30;
  if (reply.command != "IN" || reply.data.size() != kLength) return not_understood(reply);
  const std::string_view data = reply.data;
  const auto type = number(data.substr(0, 2));
  const auto travel = number(data.substr(18, 4));
  const auto pulses = number(data.substr(22, 8));
  if (!type || !travel || !pulses) return not_understood(reply);
  return Information{
      static_cast<int>(*type), std::string(data.substr(2, 8)), static_cast<int>(*travel), *pulses};
}

Result<std::int32_t> parse_position(const Reply& reply) {
  const auto pulses = reply.data.size() == 8 ? number(reply.data) : std::nullopt;
  if (reply.command != "PO" || !pulses) return not_understood(reply);
  return static_cast<std::int32_t>(*pulses);  // two's complement
}

Result<int> parse_status(const Reply& reply) {
  const auto status = reply.data.size() == 2 ? number(reply.data) : std::nullopt;
  if (reply.command != "GS" || !status) return not_understood(reply);
  return static_cast<int>(*status);
}

std::string text_of_status(int status) {
  switch (status) {
    case kStatusGood:
      return "no error";
    case 1:
      return "communication time out; check the cable";
    case 2:
      return "mechanical time out; see that nothing holds the mount, then switch it off and on";
    case 3:
      return "command not supported; is it a rotation stage?";
    case 4:
      return "value out of range";
    case 5:
      return "the module is isolated; switch it off and on";
    case 6:
      return "the module is out of isolation";
    case 7:
      return "initialising failed; switch it off and on";
    case 8:
      return "it is too hot; let it cool down";
    case kStatusBusy:
      return "it is busy";
    case 10:
      return "its sensor fails; switch it off and on";
    case 11:
      return "its motor fails; check its power supply, switch it off and on";
    case 12:
      return "beyond its travel";
    case 13:
      return "over current; check its power supply";
    default:
      return fmt::format("status {}, which is none known", status);
  }
}

std::string move_request(char address, std::int32_t pulses) {
  return fmt::format("{}ma{:08X}", address, static_cast<std::uint32_t>(pulses));
}

}  // namespace veneer::capture::elliptec
