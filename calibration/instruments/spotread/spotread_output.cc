// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/spotread/spotread_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <system_error>

namespace veneer::calibration::spotread {
namespace {

/// For texts: as much of what it said as a person reads.
constexpr std::size_t kLongestText = 600;

bool contains(std::string_view text, std::string_view part) {
  return text.find(part) != std::string_view::npos;
}

std::string_view trimmed(std::string_view text) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// "X Y Z, ..." after "Result is XYZ:"; empty for what is no reading.
std::optional<Xyz> xyz_from(std::string_view text) {
  Xyz xyz;
  for (int i = 0; i < 3; ++i) {
    text = trimmed(text);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), xyz(i));
    if (error != std::errc{} || !std::isfinite(xyz(i))) return std::nullopt;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    // Behind a number comes a space, behind the last a comma: else the number has broken off.
    const char expected = i == 2 ? ',' : ' ';
    if (text.empty() || text.front() != expected) return std::nullopt;
  }
  return xyz;
}

/// Sayings that tell of a failure, as the program (2.3.1) has them.
bool is_complaint(std::string_view line) {
  constexpr std::array<std::string_view, 12> kSayings{"failed",
                                                      "Failed",
                                                      "ailure",
                                                      "rror",
                                                      "No instrument",
                                                      "no instrument",
                                                      "got abort",
                                                      "wrong position",
                                                      "not supported",
                                                      "doesn't support",
                                                      "wrong instrument",
                                                      "Calibration retry"};
  return std::ranges::any_of(kSayings,
                             [&](std::string_view saying) { return contains(line, saying); });
}

void append(std::string& text, std::string_view line) {
  if (line.empty() || text.size() > kLongestText) return;
  if (!text.empty()) text += text.back() == ',' || text.back() == ':' ? " " : "; ";
  for (const char c : line.substr(0, kLongestText)) text += c < ' ' || c > '~' ? '?' : c;
}

}  // namespace

void Output::feed(std::string_view bytes) { pending_ += bytes; }

std::optional<Event> Output::next() {
  for (;;) {
    // A carriage return ends a line too: progress is printed over itself.
    const std::size_t end = pending_.find_first_of("\n\r");
    if (end == std::string::npos) break;
    const std::string line = pending_.substr(0, std::min(end, kLongestLine));
    pending_.erase(0, end + 1);
    if (std::optional<Event> event = take_prompt(line)) return event;
    if (std::optional<Event> event = take_line(line)) return event;
  }
  if (std::optional<Event> event = take_prompt(pending_)) {
    pending_.clear();
    return event;
  }
  if (pending_.size() > kLongestLine) pending_.erase(0, pending_.size() - kLongestLine / 2);
  return std::nullopt;
}

std::optional<Event> Output::take_prompt(std::string_view whole) {
  const std::string_view line = trimmed(whole);
  Event event;
  if (line.ends_with("any other key to take a reading:")) {
    event.kind = Event::Kind::kReady;
    event.text = complaint_;
  } else if (line.ends_with("any other key to use reading:")) {
    event.kind = Event::Kind::kSavedReading;
  } else if (line.ends_with("any other key to retry:") ||
             line.ends_with("Hit any key to retry, or Esc or Q to abort:")) {
    event.kind = Event::Kind::kRetry;
    event.text = complaint();
  } else if (line.ends_with("or hit Esc or Q to abort:") ||
             line.ends_with("or hit Esc or Q to abort, or S to skip:")) {
    event.kind = Event::Kind::kAction;
    event.text = said_;
  } else {
    return std::nullopt;
  }
  forget();
  return event;
}

std::optional<Event> Output::take_line(std::string_view whole) {
  const std::string_view line = trimmed(whole);
  constexpr std::string_view kResult = "Result is XYZ:";
  if (line.starts_with(kResult)) {
    Event event;
    const std::optional<Xyz> xyz = xyz_from(line.substr(kResult.size()));
    if (xyz) {
      event.kind = Event::Kind::kResult;
      event.xyz = *xyz;
    } else {
      event.kind = Event::Kind::kFatal;
      append(event.text, fmt::format("it prints \"{}\", which is no reading", line));
    }
    forget();
    return event;
  }
  // What keys do beside, and the keys' names: nothing to tell a person.
  if (line.starts_with("and hit [A-Z]") || line.starts_with("[a-z] to") ||
      line.starts_with("'r' to set") || line.starts_with("'h' to") || line.starts_with("'f' to") ||
      line.starts_with("and then hit any key") || line.starts_with("Hit any key to continue"))
    return std::nullopt;
  append(said_, line);
  if (is_complaint(line)) append(complaint_, line);
  if (contains(line, ": Error - ")) {
    Event event{Event::Kind::kFatal, Xyz::Zero(), complaint_};
    forget();
    return event;
  }
  return std::nullopt;
}

std::string Output::complaint() const {
  if (!complaint_.empty()) return complaint_;
  std::string text = said_;
  append(text, trimmed(pending_));
  return text;
}

void Output::forget() {
  said_.clear();
  complaint_.clear();
}

}  // namespace veneer::calibration::spotread
