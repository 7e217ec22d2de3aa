// SPDX-License-Identifier: Apache-2.0
#include "btf/direction.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <string>
#include <string_view>

#include "base/files.h"

namespace veneer::btf {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;
constexpr std::string_view kHeader = "theta,phi";

std::string_view trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::optional<double> parse_number(std::string_view text) {
  text = trim(text);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

// Directions on rings around the normal, evenly spaced from a first azimuth; degrees.
struct Ring {
  double theta;
  double first_phi;
  int count;
};
DirectionSet on_rings(std::initializer_list<Ring> rings) {
  DirectionSet directions;
  for (const Ring& ring : rings) {
    for (int i = 0; i < ring.count; ++i) {
      const double phi = ring.first_phi + 360.0 * i / ring.count;
      directions.push_back(
          direction_from_angles({ring.theta * kRadiansPerDegree, phi * kRadiansPerDegree}));
    }
  }
  return directions;
}

}  // namespace

Direction direction_from_angles(const Angles& angles) {
  const double sin_theta = std::sin(angles.theta);
  return {
      sin_theta * std::cos(angles.phi), sin_theta * std::sin(angles.phi), std::cos(angles.theta)};
}

Angles angles_from_direction(const Direction& direction) {
  if (!direction.allFinite()) return {};
  const double in_plane = std::hypot(direction.x(), direction.y());
  // atan2 of both sides keeps full precision near the normal, where acos loses half the digits.
  const double theta = std::atan2(in_plane, direction.z());
  if (in_plane == 0.0) return {theta, 0.0};
  double phi = std::atan2(direction.y(), direction.x());
  if (phi < 0.0) phi += 2.0 * std::numbers::pi;
  if (phi >= 2.0 * std::numbers::pi) phi = 0.0;  // a tiny negative angle rounds up to the full turn
  return {theta, phi};
}

DirectionSet bonn_directions() {
  return on_rings({{0.0, 0.0, 1},
                   {15.0, 0.0, 6},
                   {30.0, 0.0, 12},
                   {45.0, 0.0, 18},
                   {60.0, 0.0, 20},
                   {75.0, 0.0, 24}});
}

DirectionSet ubo2014_directions() {
  return on_rings({{0.0, 0.0, 1},
                   {11.0, 15.0, 6},
                   {23.5, 0.0, 12},
                   {30.0, 15.0, 12},
                   {37.5, 0.0, 12},
                   {45.0, 0.0, 18},
                   {52.5, 7.5, 18},
                   {60.0, 0.0, 24},
                   {67.5, 7.5, 24},
                   {75.0, 0.0, 24}});
}

std::optional<std::pair<int, int>> find_equal_directions(const DirectionSet& directions) {
  for (std::size_t j = 1; j < directions.size(); ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      if ((directions[i] - directions[j]).squaredNorm() < kEqualDirections * kEqualDirections)
        return std::pair{static_cast<int>(i), static_cast<int>(j)};
    }
  }
  return {};
}

Result<DirectionSet> read_directions(const std::filesystem::path& csv) {
  VENEER_ASSIGN(const std::string text, read_text(csv));
  DirectionSet directions;
  std::string_view rest = text;
  for (int line_number = 1; !rest.empty(); ++line_number) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view line = trim(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (line_number == 1) {
      if (line != kHeader)
        return fail(Errc::kBadFormat, "reading {}: line 1: expected \"{}\"", csv.string(), kHeader);
      continue;
    }
    if (line.empty()) continue;
    const std::size_t comma = line.find(',');
    const auto theta = parse_number(line.substr(0, comma));
    const auto phi =
        comma == std::string_view::npos ? std::nullopt : parse_number(line.substr(comma + 1));
    if (!theta || !phi || *theta < 0.0 || *theta > 90.0)
      return fail(Errc::kBadFormat,
                  "reading {}: line {}: expected theta (0 to 90) and phi in degrees, found \"{}\"",
                  csv.string(),
                  line_number,
                  line);
    directions.push_back(
        direction_from_angles({*theta * kRadiansPerDegree, *phi * kRadiansPerDegree}));
  }
  if (directions.empty())
    return fail(Errc::kBadFormat, "reading {}: it holds no direction", csv.string());
  return directions;
}

Status write_directions(const std::filesystem::path& csv, const DirectionSet& directions) {
  std::string text = fmt::format("{}\n", kHeader);
  for (const Direction& direction : directions) {
    const Angles angles = angles_from_direction(direction);
    // A hair below the horizon is rounding of a direction on it.
    const double theta = std::min(angles.theta / kRadiansPerDegree, 90.0);
    text += fmt::format("{},{}\n", theta, angles.phi / kRadiansPerDegree);
  }
  return write_text(csv, text);
}

}  // namespace veneer::btf
