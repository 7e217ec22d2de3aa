// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/gphoto2/shutter_speed.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace veneer::capture {
namespace {

// Names are rounded ("0.3" for 0.32): that much beyond an end still means the end.
constexpr double kRounding = 1.001;

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

std::optional<double> number(std::string_view text) {
  text = trimmed(text);
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value, std::chars_format::fixed);
  if (error != std::errc{} || stop != end || !std::isfinite(value) || !(value > 0)) return {};
  return value;
}

}  // namespace

std::optional<double> shutter_seconds(std::string_view name) {
  name = trimmed(name);
  if (name.ends_with('s')) name.remove_suffix(1);
  const auto slash = name.find('/');
  if (slash == std::string_view::npos) return number(name);
  const auto above = number(name.substr(0, slash));
  const auto below = number(name.substr(slash + 1));
  if (!above || !below) return {};
  const double seconds = *above / *below;
  if (!std::isfinite(seconds) || !(seconds > 0)) return {};
  return seconds;
}

std::vector<ShutterSpeed> shutter_speeds(std::span<const std::string> names) {
  std::vector<ShutterSpeed> speeds;
  for (const std::string& name : names) {
    if (const auto seconds = shutter_seconds(name)) speeds.push_back({name, *seconds});
  }
  std::stable_sort(speeds.begin(), speeds.end(), [](const ShutterSpeed& a, const ShutterSpeed& b) {
    return a.seconds < b.seconds;
  });
  return speeds;
}

Result<ShutterSpeed> nearest_speed(std::span<const ShutterSpeed> speeds, double seconds) {
  if (speeds.empty()) {
    return fail(Errc::kUnavailable,
                "the camera offers no shutter speeds; turn its mode dial to M (manual)");
  }
  const ShutterSpeed& least = speeds.front();
  const ShutterSpeed& most = speeds.back();
  // Written so that NaN is out of the range.
  if (!(seconds >= least.seconds / kRounding && seconds <= most.seconds * kRounding)) {
    return fail(Errc::kInvalidOption,
                "an exposure of {} s is out of the camera's range of {:.6g} to {:.6g} s (its "
                "\"{}\" to \"{}\")",
                seconds,
                least.seconds,
                most.seconds,
                least.name,
                most.name);
  }
  return *std::min_element(
      speeds.begin(), speeds.end(), [seconds](const ShutterSpeed& a, const ShutterSpeed& b) {
        return std::abs(std::log(a.seconds / seconds)) < std::abs(std::log(b.seconds / seconds));
      });
}

}  // namespace veneer::capture
