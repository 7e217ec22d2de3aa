// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/colour.h"
#include "base/result.h"

// What the ColorHug2 says and is told, byte by byte; nothing of how it is transported.
//
// Reports have 64 bytes and no number. A request is the command and its data, little-endian; the
// reply is a return value, the command that it answers, and data. Source: the layout that colord's
// plug-in for it shows; no code of it was taken.
namespace veneer::calibration::colorhug {

inline constexpr std::size_t kReportSize = 64;
using Report = std::array<std::byte, kReportSize>;

enum class Command : std::uint8_t {
  kFirmwareVersion = 0x07,  ///< replies three uint16: major, minor, micro
  kSerialNumber = 0x0b,     ///< replies a uint32
  kTakeReadingXyz = 0x23,   ///< takes a uint16, the calibration; replies three int32, 16.16
};

/// Indices from 64 on are mapped to a stored calibration by the device itself.
inline constexpr std::uint16_t kCalibrationProjector = 66;
inline constexpr std::uint16_t kLastCalibration = 67;

[[nodiscard]] Report firmware_version_request();
[[nodiscard]] Report serial_number_request();
[[nodiscard]] Report take_reading_request(std::uint16_t calibration);

/// How a report fits the request that was sent.
enum class ReplyKind {
  kDone,        ///< data follow
  kIncomplete,  ///< it is still busy: read again, send nothing
  kStray,       ///< the answer to another command, of before
  kFailed,      ///< see failure_text()
};
/// A report that is too short for any reply is kStray.
[[nodiscard]] ReplyKind kind_of(std::span<const std::byte> reply, Command command);
/// What the device complains of and what to do; for kFailed. Errors' codes: kBadFormat.
[[nodiscard]] Error failure_of(std::span<const std::byte> reply);

struct FirmwareVersion {
  int major = 0;
  int minor = 0;
  int micro = 0;
};
// Of a reply that is kDone. Errors: kBadFormat (too short).
[[nodiscard]] Result<FirmwareVersion> firmware_version(std::span<const std::byte> reply);
[[nodiscard]] Result<std::uint32_t> serial_number(std::span<const std::byte> reply);
[[nodiscard]] Result<Xyz> reading_xyz(std::span<const std::byte> reply);

}  // namespace veneer::calibration::colorhug
