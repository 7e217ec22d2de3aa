// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/pjlink_protocol.h"

#include <md5.h>

#include <algorithm>
#include <array>
#include <charconv>

namespace veneer::projector::pjlink {
namespace {

constexpr std::string_view kDoing = "speaking PJLink";
constexpr std::array<std::string_view, 6> kInputKinds{
    "rgb", "video", "digital", "storage", "network", "internal"};
constexpr std::array kParts{"fan", "lamp", "temperature", "cover", "filter", "other"};
constexpr std::size_t kSeedSize = 8;
constexpr std::size_t kMostLamps = 8;
constexpr std::size_t kShown = 60;

tl::unexpected<Error> not_understood(std::string_view what, std::string_view text) {
  return fail(Errc::kBadFormat,
              "{}: {} \"{}\" makes no sense; is this the projector, and its PJLink port?",
              kDoing,
              what,
              readable(text.substr(0, kShown)));
}

tl::unexpected<Error> wrong_password() {
  return fail(Errc::kInvalidOption,
              "{}: the projector refuses the password; set `password` to the one of its network "
              "menu, or clear it there",
              kDoing);
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_hex(char c) { return is_digit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }
bool is_input_number(char c) { return (c >= '1' && c <= '9') || (c >= 'A' && c <= 'Z'); }

/// The bytes of the UTF-8 character that `text` begins with; 0 where it begins with none.
std::size_t character_size(std::string_view text) {
  const auto at = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = at(0);
  if (first < 0x80) return first >= 0x20 && first != 0x7F ? 1 : 0;
  const std::size_t size = first >= 0xC2 && first <= 0xDF   ? 2
                           : first >= 0xE0 && first <= 0xEF ? 3
                           : first >= 0xF0 && first <= 0xF4 ? 4
                                                            : 0;
  if (size == 0 || size > text.size()) return 0;
  for (std::size_t i = 1; i < size; ++i)
    if ((at(i) & 0xC0U) != 0x80) return 0;
  // Overlong forms, surrogates, and what lies beyond the last plane.
  if ((first == 0xE0 && at(1) < 0xA0) || (first == 0xED && at(1) > 0x9F) ||
      (first == 0xF0 && at(1) < 0x90) || (first == 0xF4 && at(1) > 0x8F))
    return 0;
  return size;
}

}  // namespace

Result<Greeting> read_greeting(std::string_view line) {
  // A refusal begins like a greeting.
  if (line == "PJLINK ERRA") return wrong_password();
  if (line == "PJLINK 0") return Greeting{};
  constexpr std::string_view kWithSeed = "PJLINK 1 ";
  if (line.starts_with(kWithSeed)) {
    const std::string_view seed = line.substr(kWithSeed.size());
    if (seed.size() == kSeedSize && std::ranges::all_of(seed, is_hex))
      return Greeting{std::string(seed)};
  }
  return not_understood("the greeting", line);
}

std::string digest(std::string_view seed, std::string_view password) {
  const std::string text = std::string(seed) + std::string(password);
  std::array<char, MD5_DIGEST_STRING_LENGTH> hex{};
  MD5Data(reinterpret_cast<const std::uint8_t*>(text.data()), text.size(), hex.data());
  return hex.data();
}

std::string line_of(const Request& request) {
  return fmt::format("%{}{} {}\r", request.protocol_class, request.letters, request.parameter);
}

Result<Reply> read_reply(std::string_view line, const Request& request) {
  if (line == "PJLINK ERRA") return wrong_password();
  const std::string head = fmt::format("%{}{}=", request.protocol_class, request.letters);
  if (!line.starts_with(head)) return not_understood("the reply", line);
  const std::string_view parameter = line.substr(head.size());
  if (parameter == "ERRA") return wrong_password();
  Reply reply{std::string(parameter), 0};
  if (parameter.size() == 4 && parameter.starts_with("ERR") && parameter[3] >= '1' &&
      parameter[3] <= '4')
    reply.refusal = parameter[3] - '0';
  return reply;
}

Error error_of(const Reply& refused, const Request& request) {
  const std::string asked = readable(fmt::format("{} {}", request.letters, request.parameter));
  switch (refused.refusal) {
    case 1:
      return {
          Errc::kUnavailable,
          fmt::format(
              "{}: the projector does not know \"{}\"; use its own menu for that", kDoing, asked)};
    case 2:
      return {
          Errc::kInvalidOption,
          fmt::format("{}: the projector does not take \"{}\"; choose an input or value that it "
                      "has",
                      kDoing,
                      asked)};
    case 3:
      return {Errc::kUnavailable,
              fmt::format("{}: the projector cannot do \"{}\" at present: it is off, warming up or "
                          "cooling; switch it on or wait, then try again",
                          kDoing,
                          asked)};
    default:
      return {Errc::kIo,
              fmt::format("{}: the projector has failed (\"{}\"); look at its lamps and its manual",
                          kDoing,
                          asked)};
  }
}

Result<Power> read_power(std::string_view parameter) {
  constexpr std::array kPowers{Power::kOff, Power::kOn, Power::kCooling, Power::kWarmUp};
  if (parameter.size() != 1 || parameter[0] < '0' || parameter[0] > '3')
    return not_understood("the power", parameter);
  return kPowers.at(static_cast<std::size_t>(parameter[0] - '0'));
}

Result<bool> read_mute(std::string_view parameter) {
  if (parameter.size() != 2 || parameter[0] < '1' || parameter[0] > '3' ||
      (parameter[1] != '0' && parameter[1] != '1'))
    return not_understood("the mute", parameter);
  // "2x" speaks of the sound alone: the picture is on.
  return parameter[0] != '2' && parameter[1] == '1';
}

Result<std::map<std::string, Health>> read_health(std::string_view parameter) {
  std::map<std::string, Health> health;
  if (parameter.size() != kParts.size()) return not_understood("the error status", parameter);
  for (std::size_t i = 0; i < kParts.size(); ++i) {
    if (parameter[i] < '0' || parameter[i] > '2')
      return not_understood("the error status", parameter);
    health[kParts.at(i)] = static_cast<Health>(parameter[i] - '0');
  }
  return health;
}

Result<std::vector<Lamp>> read_lamps(std::string_view parameter) {
  constexpr std::size_t kMostDigits = 6;  // five by the specification
  std::vector<Lamp> lamps;
  std::string_view rest = parameter;
  while (!rest.empty()) {
    const std::size_t digits = std::min(rest.find(' '), rest.size());
    int hours = 0;
    const auto [end, error] = std::from_chars(rest.data(), rest.data() + digits, hours);
    const bool is_number = digits > 0 && digits <= kMostDigits && is_digit(rest[0]) &&
                           error == std::errc{} && end == rest.data() + digits;
    if (!is_number || rest.size() < digits + 2 || lamps.size() == kMostLamps)
      return not_understood("the lamps", parameter);
    const char on = rest[digits + 1];
    rest.remove_prefix(digits + 2);
    if (on != '0' && on != '1') return not_understood("the lamps", parameter);
    lamps.push_back({hours, on == '1'});
    if (rest.empty()) return lamps;
    if (rest[0] != ' ' || rest.size() == 1) break;
    rest.remove_prefix(1);
  }
  return not_understood("the lamps", parameter);
}

std::optional<Resolution> read_resolution(std::string_view parameter) {
  constexpr std::size_t kMostDigits = 5;
  const auto number_of = [](std::string_view text) {
    int value = 0;
    if (!text.empty() && text.size() <= kMostDigits && std::ranges::all_of(text, is_digit))
      std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
  };
  const std::size_t cross = parameter.find('x');
  if (cross == std::string_view::npos) return std::nullopt;
  const Resolution size{number_of(parameter.substr(0, cross)),
                        number_of(parameter.substr(cross + 1))};
  return size.width > 0 && size.height > 0 ? std::optional(size) : std::nullopt;
}

Result<bool> read_flag(std::string_view parameter) {
  if (parameter == "0") return false;
  if (parameter == "1") return true;
  return not_understood("the value", parameter);
}

Result<std::string> input_name(std::string_view code) {
  if (code.size() != 2 || code[0] < '1' || code[0] > '6' || !is_input_number(code[1]))
    return not_understood("the input", code);
  return fmt::format("{}{}", kInputKinds.at(static_cast<std::size_t>(code[0] - '1')), code[1]);
}

Result<std::string> input_code(std::string_view name) {
  if (input_name(name)) return std::string(name);
  for (std::size_t i = 0; i < kInputKinds.size(); ++i) {
    const std::string_view kind = kInputKinds.at(i);
    if (name.size() == kind.size() + 1 && name.starts_with(kind) && is_input_number(name.back()))
      return fmt::format("{}{}", i + 1, name.back());
  }
  return fail(Errc::kInvalidOption,
              "{}: there is no input \"{}\"; write rgb, video, digital, storage, network or "
              "internal and a number, as digital1, or the projector's code, as 31",
              kDoing,
              readable(name));
}

Result<std::string> read_acknowledgement(std::string_view datagram) {
  constexpr std::string_view kHead = "%2ACKN=";
  constexpr std::string_view kShape = "00:00:00:00:00:00";
  std::string_view line = datagram;
  while (line.ends_with('\n') || line.ends_with('\r')) line.remove_suffix(1);
  std::string mac(line.starts_with(kHead) ? line.substr(kHead.size()) : "");
  bool good = mac.size() == kShape.size();
  for (std::size_t i = 0; good && i < mac.size(); ++i)
    good = kShape[i] == ':' ? mac[i] == ':' : is_hex(mac[i]);
  if (!good) return not_understood("the answer to a search", line);
  std::ranges::transform(mac, mac.begin(), [](char c) {
    return c >= 'A' && c <= 'F' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return mac;
}

std::string readable(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t size = character_size(text);
    result += size == 0 ? std::string_view("?") : text.substr(0, size);
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return result;
}

}  // namespace veneer::projector::pjlink
