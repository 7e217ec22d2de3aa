// SPDX-License-Identifier: Apache-2.0
#include "service/bus/command.h"

#include <algorithm>
#include <array>
#include <climits>

#include "service/bus/names.h"

namespace veneer::service {
namespace {

constexpr std::size_t kShown = 200;  // bytes of a path in a text

template <class... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};
template <class... Ts>
Overloaded(Ts...) -> Overloaded<Ts...>;

constexpr std::array kErrorNames{std::pair{Errc::kNotFound, "NotFound"},
                                 std::pair{Errc::kIo, "Io"},
                                 std::pair{Errc::kBadFormat, "BadFormat"},
                                 std::pair{Errc::kInvalidOption, "InvalidOption"},
                                 std::pair{Errc::kUnavailable, "Unavailable"},
                                 std::pair{Errc::kTimeout, "Timeout"},
                                 std::pair{Errc::kDisconnected, "Disconnected"},
                                 std::pair{Errc::kCancelled, "Cancelled"}};

std::string error_prefix() { return std::string(kInterface) + ".Error."; }

/// The length of the UTF-8 character that `text` begins with; 0 where it begins with none. Follows
/// the table of well-formed byte sequences of the Unicode Standard 15, chapter 3.9.
std::size_t character_length(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const auto within = [&](std::size_t i, unsigned low, unsigned high) {
    return byte(i) >= low && byte(i) <= high;
  };
  const auto follows = [&](std::size_t i) { return within(i, 0x80, 0xBF); };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  if (within(0, 0xC2, 0xDF)) return follows(1) ? 2 : 0;
  if (within(0, 0xE0, 0xEF)) {
    // No overlong forms, no surrogates.
    const bool second = within(1, first == 0xE0 ? 0xA0 : 0x80, first == 0xED ? 0x9F : 0xBF);
    return second && follows(2) ? 3 : 0;
  }
  if (within(0, 0xF0, 0xF4)) {
    const bool second = within(1, first == 0xF0 ? 0x90 : 0x80, first == 0xF4 ? 0x8F : 0xBF);
    return second && follows(2) && follows(3) ? 4 : 0;
  }
  return 0;
}

bool is_control(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return byte < 0x20 || byte == 0x7F;
}

std::string shown(const std::string& path) {
  return readable(path.size() <= kShown ? path : path.substr(0, kShown) + "...");
}

Status check_path(std::string_view doing, const std::string& path) {
  if (path.empty()) return fail(Errc::kInvalidOption, "{}: the path is empty", doing);
  if (path.size() >= PATH_MAX)
    return fail(Errc::kInvalidOption,
                "{}: the path is {} bytes long; at most {} are possible",
                doing,
                path.size(),
                PATH_MAX - 1);
  if (path.front() != '/')
    return fail(Errc::kInvalidOption,
                "{}: {} is not absolute; the service stands in another folder, so give the whole "
                "path from /",
                doing,
                shown(path));
  if (std::ranges::any_of(path, is_control))
    return fail(Errc::kInvalidOption, "{}: {} holds control characters", doing, shown(path));
  return {};
}

Result<std::string> nothing(const Status& status) {
  if (!status) return tl::unexpected(status.error());
  return std::string();
}

}  // namespace

std::string readable(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const std::size_t length = character_length(text);
    if (length == 0 || is_control(text.front())) {
      result += text.front() == '\n' ? '\n' : '?';
    } else {
      result += text.substr(0, length);
    }
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return result;
}

std::string text_of(const Command& command) {
  return std::visit(
      Overloaded{[](const LoadMaterial& c) { return "loading the material " + shown(c.path); },
                 [](const SetScene& c) { return "setting the scene " + shown(c.path); },
                 [](const SetLight& c) { return fmt::format("setting light {}", c.index); },
                 [](const Blank& c) { return std::string(c.on ? "blanking" : "unblanking"); },
                 [](const Reload&) { return std::string("reloading"); },
                 [](const Snapshot&) { return std::string("taking a snapshot"); }},
      command);
}

std::string_view method_name_of(const Command& command) {
  constexpr std::array<std::string_view, std::variant_size_v<Command>> kNames{
      "LoadMaterial", "SetScene", "SetLight", "Blank", "Reload", "Snapshot"};
  return kNames[command.index()];
}

Status check(const Command& command) {
  return std::visit(
      Overloaded{[](const LoadMaterial& c) { return check_path("loading a material", c.path); },
                 [](const SetScene& c) { return check_path("setting a scene", c.path); },
                 [](const SetLight& c) -> Status {
                   if (c.index < 0)
                     return fail(Errc::kInvalidOption,
                                 "setting a light: there is no light {}; they count from 0",
                                 c.index);
                   return c.light.check();
                 },
                 [](const auto&) { return Status{}; }},
      command);
}

Result<std::string> carry_out(const Command& command, ServiceControl& control) {
  VENEER_TRY(check(command));
  return std::visit(
      Overloaded{[&](const LoadMaterial& c) { return nothing(control.load_material(c.path)); },
                 [&](const SetScene& c) { return nothing(control.set_scene(c.path)); },
                 [&](const SetLight& c) { return nothing(control.set_light(c.index, c.light)); },
                 [&](const Blank& c) { return nothing(control.blank(c.on)); },
                 [&](const Reload&) { return nothing(control.reload()); },
                 [&](const Snapshot&) -> Result<std::string> {
                   VENEER_ASSIGN(const std::filesystem::path picture, control.snapshot());
                   return picture.string();
                 }},
      command);
}

std::string error_name_of(Errc code) {
  const auto* found = std::ranges::find(kErrorNames, code, [](const auto& e) { return e.first; });
  VENEER_CHECK(found != kErrorNames.end());
  return error_prefix() + found->second;
}

Errc errc_of(std::string_view error_name) {
  for (const auto& [code, name] : kErrorNames)
    if (error_name == error_prefix() + name) return code;
  return Errc::kUnavailable;
}

}  // namespace veneer::service
