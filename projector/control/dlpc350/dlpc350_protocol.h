// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "projector/control.h"

// What the TI DLPC350 (LightCrafter 4500) says and is told over USB, byte by byte; nothing of how
// it is transported.
//
// Reports have 64 bytes and no number. A message is flags, sequence number, length (uint16) and its
// payload; what does not fit into one report goes on in the next, without a header. A request's
// payload is the command (CMD3 before CMD2) and its parameters; a reply's is data alone. Numbers
// are little-endian. Source: the packets that slstudio and pyCrafter4500 send; no code of theirs
// was taken.
namespace veneer::projector::dlpc350 {

inline constexpr std::size_t kReportSize = 64;
inline constexpr std::size_t kHeaderSize = 4;
/// Of a reply; the device has no longer ones, and a broken length must not be believed.
inline constexpr std::size_t kLongestReply = 512;
using Report = std::array<std::byte, kReportSize>;
using Bytes = std::vector<std::byte>;

/// CMD2 in the high byte, CMD3 in the low one.
enum class Command : std::uint16_t {
  kPower = 0x0200,        ///< 1: standby
  kVersion = 0x0205,      ///< 4 x uint32: application, API, software and sequence configuration
  kVideoSignal = 0x071C,  ///< 28 bytes; bits 0 and 1 of the first: 2 is locked
  kLedCurrent = 0x0B01,   ///< red, green, blue
  kFreeze = 0x100A,       ///< 1: frozen
  kTestPattern = 0x1203,  ///< 0 solid to 10 step bars
  kInputSource = 0x1A00,  ///< bits 0 to 2 the source, 3 to 5 its width
  kPwmInvert = 0x1A05,    ///< whether a greater LED value is more light
  kLedEnable = 0x1A07,    ///< bits 0 to 2 red, green, blue by hand; 3: the sequencer's
  kHardwareStatus = 0x1A0A,
  kSystemStatus = 0x1A0B,
  kMainStatus = 0x1A0C,   ///< bit 0 parked, 1 sequencer runs, 2 frozen, 3 degamma on
  kGamma = 0x1A0E,        ///< bit 7 degamma on, the low bits its table
  kDisplayMode = 0x1A1B,  ///< 0 video, 1 pattern
};

// Messages as reports, the last one filled up with zeros.
[[nodiscard]] std::vector<Report> read_request(Command command, std::uint8_t sequence);
/// A command that wants an acknowledgement.
[[nodiscard]] std::vector<Report> write_request(Command command,
                                                std::uint8_t sequence,
                                                std::span<const std::byte> parameters);

/// Puts a reply together from its reports.
class ReplyReader {
 public:
  enum class Step {
    kMore,      ///< another report belongs to it
    kDone,      ///< data() is whole
    kRefused,   ///< NACK: the device does not know the command, or not now
    kStray,     ///< a report that does not begin the reply that is waited for
    kNonsense,  ///< a length that cannot be
  };
  ReplyReader(std::uint8_t sequence, bool is_read) : sequence_(sequence), is_read_(is_read) {}
  /// @param report  as it came, however short or long; what is beyond 64 bytes is ignored.
  [[nodiscard]] Step add(std::span<const std::byte> report);
  [[nodiscard]] const Bytes& data() const { return data_; }

 private:
  std::uint8_t sequence_;
  bool is_read_;
  bool begun_ = false;
  std::size_t length_ = 0;
  Bytes data_;
};

// Of the data of replies; longer data are taken, shorter ones are kBadFormat.
/// The application's, "4.1.0".
[[nodiscard]] Result<std::string> read_version(std::span<const std::byte> data);
[[nodiscard]] Result<std::uint8_t> read_byte(std::span<const std::byte> data);
[[nodiscard]] Result<bool> read_lock(std::span<const std::byte> data);
/// @param inverted  what kPwmInvert reads. Without it a value of 255 is no light.
[[nodiscard]] Result<LedLevels> read_led_levels(std::span<const std::byte> data, bool inverted);

struct MainStatus {
  bool parked = false;
  bool sequencer_runs = false;
  bool frozen = false;
  bool degamma = false;
};
[[nodiscard]] MainStatus main_status(std::uint8_t byte);
/// Of the hardware's and the system's status.
[[nodiscard]] Health health_of(std::uint8_t hardware, std::uint8_t system);

inline constexpr std::uint8_t kSequencerControl = 0x08;  ///< of kLedEnable
/// "sequencer", or those that are lit by hand, as "red blue"; empty for none.
[[nodiscard]] std::string led_enable_name(std::uint8_t enabled);
/// The byte for such a name; colours in any order. Errors: kInvalidOption, for none of them too.
[[nodiscard]] Result<std::uint8_t> led_enable_byte(std::string_view name);
[[nodiscard]] constexpr std::uint8_t with_degamma(std::uint8_t gamma, bool on) {
  return static_cast<std::uint8_t>((gamma & 0x7FU) | (on ? 0x80U : 0U));
}
/// Errors: kInvalidOption (a level out of 0 to 255).
[[nodiscard]] Result<std::array<std::byte, 3>> led_parameters(const LedLevels& levels,
                                                              bool inverted);
/// "parallel" (HDMI), "test-pattern", "flash", "fpd-link"; "unknown" for the rest.
[[nodiscard]] std::string_view input_name(std::uint8_t source);
/// The byte for an input, with the width that `now` has. Errors: kInvalidOption.
[[nodiscard]] Result<std::uint8_t> with_input(std::uint8_t now, std::string_view name);
/// "solid", "horizontal-ramp" ... Errors: kInvalidOption, with the known ones.
[[nodiscard]] Result<std::uint8_t> test_pattern(std::string_view name);

}  // namespace veneer::projector::dlpc350
