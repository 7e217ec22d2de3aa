// SPDX-License-Identifier: Apache-2.0
#include "daemon/memory_pressure.h"

#include <charconv>
#include <string>

#include "base/files.h"

namespace veneer::daemon {

Result<double> parse_memory_pressure(std::string_view text) {
  constexpr std::string_view kKey = "some avg10=";
  const std::size_t at = text.find(kKey);
  if (at != std::string_view::npos) {
    const std::string_view rest = text.substr(at + kKey.size());
    double percent = 0;
    const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), percent);
    if (error == std::errc{} && percent >= 0 && percent <= 100) return percent / 100;
  }
  return fail(Errc::kBadFormat, "reading the memory pressure: it has no \"{}\" of 0 to 100", kKey);
}

Result<double> memory_pressure() {
  const Result<std::string> text = read_text("/proc/pressure/memory");
  if (!text)
    return fail(Errc::kUnavailable, "this kernel tells no memory pressure: {}", text.error().what);
  return parse_memory_pressure(*text);
}

}  // namespace veneer::daemon
