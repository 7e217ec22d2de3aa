// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/colorhug/colorhug_protocol.h"

namespace veneer::calibration::colorhug {
namespace {

// Of a reply: what it starts with.
constexpr std::size_t kReturnValue = 0;
constexpr std::size_t kEcho = 1;
constexpr std::size_t kData = 2;

constexpr std::uint8_t kOk = 0x00;
constexpr std::uint8_t kIncompleteRequest = 0x12;

Report request(Command command) {
  Report report{};
  report[0] = static_cast<std::byte>(command);
  return report;
}

std::uint32_t little_endian(std::span<const std::byte> bytes, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i)
    value |= std::to_integer<std::uint32_t>(bytes[at + i]) << (8 * i);
  return value;
}

Status check_length(std::span<const std::byte> reply, std::size_t data) {
  if (reply.size() >= kData + data) return {};
  return fail(Errc::kBadFormat,
              "reading a ColorHug: its reply has {} bytes, fewer than {}; plug it out and in again",
              reply.size(),
              kData + data);
}

}  // namespace

Report firmware_version_request() { return request(Command::kFirmwareVersion); }
Report serial_number_request() { return request(Command::kSerialNumber); }

Report take_reading_request(std::uint16_t calibration) {
  Report report = request(Command::kTakeReadingXyz);
  report[1] = static_cast<std::byte>(calibration & 0xFFU);
  report[2] = static_cast<std::byte>(calibration >> 8U);
  return report;
}

ReplyKind kind_of(std::span<const std::byte> reply, Command command) {
  if (reply.size() < kData || reply[kEcho] != static_cast<std::byte>(command))
    return ReplyKind::kStray;
  switch (std::to_integer<std::uint8_t>(reply[kReturnValue])) {
    case kOk:
      return ReplyKind::kDone;
    case kIncompleteRequest:
      return ReplyKind::kIncomplete;
    default:
      return ReplyKind::kFailed;
  }
}

Error failure_of(std::span<const std::byte> reply) {
  const int value = reply.empty() ? -1 : std::to_integer<int>(reply[kReturnValue]);
  constexpr std::string_view kDoing = "reading a ColorHug";
  switch (value) {
    case 0x01:
      return {Errc::kBadFormat,
              fmt::format("{}: its firmware does not know the command; update it", kDoing)};
    case 0x04:
      return {Errc::kBadFormat,
              fmt::format("{}: its sensor gets too little light; see that it points at the lit "
                          "spot and that the lamp is on",
                          kDoing)};
    case 0x0C:
      return {Errc::kBadFormat,
              fmt::format("{}: it holds no calibration of that number; set calibration to one that "
                          "it has (0 is the factory's)",
                          kDoing)};
    case 0x0F:
      return {Errc::kBadFormat,
              fmt::format("{}: its sensor gets too much light; move it away from the spot or put a "
                          "grey filter before it",
                          kDoing)};
    default:
      return {Errc::kBadFormat,
              fmt::format("{}: it complains with number {:#04x}; plug it out and in again, and "
                          "update its firmware if this lasts",
                          kDoing,
                          value)};
  }
}

Result<FirmwareVersion> firmware_version(std::span<const std::byte> reply) {
  VENEER_TRY(check_length(reply, 6));
  const auto part = [&](std::size_t i) {
    return static_cast<int>(little_endian(reply, kData + 2 * i, 2));
  };
  return FirmwareVersion{part(0), part(1), part(2)};
}

Result<std::uint32_t> serial_number(std::span<const std::byte> reply) {
  VENEER_TRY(check_length(reply, 4));
  return little_endian(reply, kData, 4);
}

Result<Xyz> reading_xyz(std::span<const std::byte> reply) {
  VENEER_TRY(check_length(reply, 12));
  constexpr double kOne = 65536.0;  // 16 bits before the point, 16 behind
  const auto part = [&](std::size_t i) {
    return static_cast<std::int32_t>(little_endian(reply, kData + 4 * i, 4)) / kOne;
  };
  return Xyz(part(0), part(1), part(2));
}

}  // namespace veneer::calibration::colorhug
