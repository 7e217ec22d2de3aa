// SPDX-License-Identifier: Apache-2.0
#include "projector/control/dlpc350/dlpc350_protocol.h"

#include <algorithm>

namespace veneer::projector::dlpc350 {
namespace {

constexpr std::uint8_t kReadBit = 0x80;
constexpr std::uint8_t kReplyWanted = 0x40;
constexpr std::uint8_t kNack = 0x20;
constexpr std::size_t kVideoSignalSize = 28;
constexpr std::array<std::string_view, 4> kInputs{"parallel", "test-pattern", "flash", "fpd-link"};
/// By their bits of kLedEnable.
constexpr std::array<std::string_view, 3> kLeds{"red", "green", "blue"};
constexpr std::string_view kSequencer = "sequencer";
/// Names from memory of TI's programmer's guide; the two ends are in the sources.
constexpr std::array<std::string_view, 11> kPatterns{"solid",
                                                     "horizontal-ramp",
                                                     "vertical-ramp",
                                                     "horizontal-lines",
                                                     "diagonal-lines",
                                                     "vertical-lines",
                                                     "grid",
                                                     "checkerboard",
                                                     "rgb-ramp",
                                                     "colour-bars",
                                                     "step-bars"};

std::vector<Report> message(std::uint8_t flags,
                            std::uint8_t sequence,
                            Command command,
                            std::span<const std::byte> parameters) {
  const auto number = static_cast<std::uint16_t>(command);
  const std::size_t length = parameters.size() + 2;
  Bytes bytes{static_cast<std::byte>(flags),
              static_cast<std::byte>(sequence),
              static_cast<std::byte>(length & 0xFFU),
              static_cast<std::byte>(length >> 8U),
              static_cast<std::byte>(number & 0xFFU),
              static_cast<std::byte>(number >> 8U)};
  bytes.insert(bytes.end(), parameters.begin(), parameters.end());
  std::vector<Report> reports((bytes.size() + kReportSize - 1) / kReportSize, Report{});
  for (std::size_t i = 0; i < bytes.size(); ++i)
    reports[i / kReportSize].at(i % kReportSize) = bytes[i];
  return reports;
}

Status check_length(std::span<const std::byte> data, std::size_t wanted) {
  if (data.size() >= wanted) return {};
  return fail(
      Errc::kBadFormat,
      "reading a DLPC350: its reply has {} bytes of data, fewer than {}; plug it out and in "
      "again",
      data.size(),
      wanted);
}

template <std::size_t kSize>
tl::unexpected<Error> unknown_name(std::string_view what,
                                   std::string_view name,
                                   const std::array<std::string_view, kSize>& names) {
  std::string known;
  for (const std::string_view each : names) known += fmt::format(" {}", each);
  return fail(Errc::kInvalidOption,
              "commanding a DLPC350: it has no {} \"{}\"; choose one of{}",
              what,
              name,
              known);
}

}  // namespace

std::vector<Report> read_request(Command command, std::uint8_t sequence) {
  return message(kReadBit | kReplyWanted, sequence, command, {});
}

std::vector<Report> write_request(Command command,
                                  std::uint8_t sequence,
                                  std::span<const std::byte> parameters) {
  return message(kReplyWanted, sequence, command, parameters);
}

ReplyReader::Step ReplyReader::add(std::span<const std::byte> report) {
  report = report.first(std::min(report.size(), kReportSize));
  if (!begun_) {
    if (report.size() < kHeaderSize) return Step::kStray;
    const auto at = [&](std::size_t i) { return std::to_integer<std::uint8_t>(report[i]); };
    const bool answers_read = (at(0) & kReadBit) != 0;
    if (at(1) != sequence_ || answers_read != is_read_) return Step::kStray;
    if ((at(0) & kNack) != 0) return Step::kRefused;
    length_ = at(2) | (static_cast<std::size_t>(at(3)) << 8U);
    if (length_ > kLongestReply) return Step::kNonsense;
    begun_ = true;
    report = report.subspan(kHeaderSize);
  } else if (report.empty()) {
    return Step::kNonsense;
  }
  const std::size_t take = std::min(report.size(), length_ - data_.size());
  data_.insert(data_.end(), report.begin(), report.begin() + static_cast<std::ptrdiff_t>(take));
  return data_.size() == length_ ? Step::kDone : Step::kMore;
}

Result<std::string> read_version(std::span<const std::byte> data) {
  VENEER_TRY(check_length(data, 4));
  const auto at = [&](std::size_t i) { return std::to_integer<int>(data[i]); };
  return fmt::format("{}.{}.{}", at(3), at(2), at(0) + 256 * at(1));
}

Result<std::uint8_t> read_byte(std::span<const std::byte> data) {
  VENEER_TRY(check_length(data, 1));
  return std::to_integer<std::uint8_t>(data[0]);
}

Result<bool> read_lock(std::span<const std::byte> data) {
  VENEER_TRY(check_length(data, kVideoSignalSize));
  return (std::to_integer<int>(data[0]) & 3) == 2;
}

Result<LedLevels> read_led_levels(std::span<const std::byte> data, bool inverted) {
  VENEER_TRY(check_length(data, 3));
  LedLevels levels{};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const int value = std::to_integer<int>(data[i]);
    levels.at(i) = inverted ? value : 255 - value;
  }
  return levels;
}

MainStatus main_status(std::uint8_t byte) {
  return {(byte & 1U) != 0, (byte & 2U) != 0, (byte & 4U) != 0, (byte & 8U) != 0};
}

Health health_of(std::uint8_t hardware, std::uint8_t system) {
  // From memory of TI's programmer's guide. Hardware: bit 0 the initialisation succeeded, 2 the
  // mirrors' reset failed, 3 a forced swap, 6 and 7 the sequencer aborted or failed. System: bit 0
  // the memory's test succeeded.
  if ((hardware & 0x01U) == 0 || (hardware & 0x84U) != 0 || (system & 0x01U) == 0)
    return Health::kError;
  return (hardware & 0x48U) != 0 ? Health::kWarning : Health::kOk;
}

Result<std::array<std::byte, 3>> led_parameters(const LedLevels& levels, bool inverted) {
  std::array<std::byte, 3> parameters{};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const int level = levels.at(i);
    if (level < 0 || level > 255)
      return fail(Errc::kInvalidOption,
                  "commanding a DLPC350: the LED level {} is out of range; set it from 0 to 255",
                  level);
    parameters.at(i) = static_cast<std::byte>(inverted ? level : 255 - level);
  }
  return parameters;
}

std::string led_enable_name(std::uint8_t enabled) {
  // What the other bits say is not heeded then.
  if ((enabled & kSequencerControl) != 0) return std::string(kSequencer);
  std::string name;
  for (std::size_t i = 0; i < kLeds.size(); ++i)
    if ((enabled & (1U << i)) != 0)
      name += fmt::format("{}{}", name.empty() ? "" : " ", kLeds.at(i));
  return name;
}

Result<std::uint8_t> led_enable_byte(std::string_view name) {
  if (name == kSequencer) return kSequencerControl;
  unsigned byte = 0;
  std::string_view rest = name;
  while (true) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    const auto led = std::ranges::find(kLeds, rest.substr(0, end));
    if (led == kLeds.end())
      return fail(Errc::kInvalidOption,
                  "commanding a DLPC350: nothing called \"{}\" lights its LEDs; write "
                  "\"sequencer\", or those that are lit by hand, as \"red blue\"",
                  name);
    byte |= 1U << static_cast<unsigned>(led - kLeds.begin());
    if (end == rest.size()) return static_cast<std::uint8_t>(byte);
    rest.remove_prefix(end + 1);
  }
}

std::string_view input_name(std::uint8_t source) {
  const std::size_t number = source & 7U;
  return number < kInputs.size() ? kInputs.at(number) : std::string_view("unknown");
}

Result<std::uint8_t> with_input(std::uint8_t now, std::string_view name) {
  const auto found = std::ranges::find(kInputs, name);
  if (found == kInputs.end()) return unknown_name("input", name, kInputs);
  return static_cast<std::uint8_t>((now & 0xF8U) | static_cast<unsigned>(found - kInputs.begin()));
}

Result<std::uint8_t> test_pattern(std::string_view name) {
  const auto found = std::ranges::find(kPatterns, name);
  if (found == kPatterns.end()) return unknown_name("test pattern", name, kPatterns);
  return static_cast<std::uint8_t>(found - kPatterns.begin());
}

}  // namespace veneer::projector::dlpc350
