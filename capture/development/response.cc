// SPDX-License-Identifier: Apache-2.0
#include "capture/development/response.h"

#include <algorithm>
#include <cmath>

namespace veneer::capture {
namespace {

constexpr int kGammaEntries = 1025;  // chords of light^2.2 leave it by less than 1e-6

/// Which two entries a place lies between, and how far, as whole and part of an index.
struct Place {
  std::size_t index = 0;
  double part = 0;
};
Place place_of(const std::vector<double>& table, double fraction) {
  const double last = static_cast<double>(table.size() - 1);
  const double scaled = fraction > 0 ? std::min(fraction, 1.0) * last : 0.0;  // NaN is 0
  const auto index = std::min(static_cast<std::size_t>(scaled), table.size() - 2);
  return {index, scaled - static_cast<double>(index)};
}

}  // namespace

ResponseCurve::ResponseCurve() { light_.fill({0.0, 1.0}); }

Result<ResponseCurve> ResponseCurve::gamma(double gamma) {
  if (!(gamma >= 0.1 && gamma <= 10)) {
    return fail(Errc::kInvalidOption,
                "response of the camera: gamma is {}; give 0.1 to 10, 1 for a linear camera",
                gamma);
  }
  ResponseCurve curve;
  if (gamma == 1) return curve;
  std::vector<double> light(kGammaEntries);
  for (int i = 0; i < kGammaEntries; ++i)
    light[static_cast<std::size_t>(i)] =
        std::pow(static_cast<double>(i) / (kGammaEntries - 1), gamma);
  curve.light_.fill(light);
  return curve;
}

Result<ResponseCurve> ResponseCurve::tabulated(const std::array<std::vector<double>, 3>& light) {
  ResponseCurve curve;
  for (int channel = 0; channel < 3; ++channel) {
    const std::vector<double>& table = light[static_cast<std::size_t>(channel)];
    if (table.size() < 2) {
      return fail(Errc::kInvalidOption,
                  "response of the camera: channel {} has {} entries; give 2 or more",
                  channel,
                  table.size());
    }
    for (std::size_t i = 0; i < table.size(); ++i) {
      if (!std::isfinite(table[i]) || (i > 0 && !(table[i] > table[i - 1]))) {
        return fail(Errc::kInvalidOption,
                    "response of the camera: entry {} of channel {} is {}, which is not above the "
                    "one before; light has to rise from entry to entry",
                    i,
                    channel,
                    table[i]);
      }
    }
    std::vector<double>& own = curve.light_[static_cast<std::size_t>(channel)];
    own.resize(table.size());
    const double range = table.back() - table.front();
    for (std::size_t i = 0; i < table.size(); ++i) own[i] = (table[i] - table.front()) / range;
  }
  return curve;
}

double ResponseCurve::light(int channel, double counts_fraction) const {
  const std::vector<double>& table = light_[static_cast<std::size_t>(channel)];
  const auto [index, part] = place_of(table, counts_fraction);
  return (1 - part) * table[index] + part * table[index + 1];
}

double ResponseCurve::slope(int channel, double counts_fraction) const {
  const std::vector<double>& table = light_[static_cast<std::size_t>(channel)];
  const std::size_t index = place_of(table, counts_fraction).index;
  return (table[index + 1] - table[index]) * static_cast<double>(table.size() - 1);
}

double ResponseCurve::counts_fraction(int channel, double light) const {
  const std::vector<double>& table = light_[static_cast<std::size_t>(channel)];
  if (!(light > 0)) return 0;
  if (light >= 1) return 1;
  const auto above = std::ranges::upper_bound(table, light);
  const auto index = static_cast<std::size_t>(above - table.begin()) - 1;
  const double part = (light - table[index]) / (table[index + 1] - table[index]);
  return (static_cast<double>(index) + part) / static_cast<double>(table.size() - 1);
}

bool ResponseCurve::linear() const {
  return std::ranges::all_of(light_, [](const std::vector<double>& table) {
    const double last = static_cast<double>(table.size() - 1);
    for (std::size_t i = 0; i < table.size(); ++i)
      if (std::abs(table[i] - static_cast<double>(i) / last) > 1e-12) return false;
    return true;
  });
}

}  // namespace veneer::capture
