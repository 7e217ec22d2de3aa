// SPDX-License-Identifier: Apache-2.0
#include "capture/development/hdr_merge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/parallel.h"

namespace veneer::capture {
namespace {

constexpr double kRoundingVariance = 1.0 / 12;  // of a count that is rounded to a whole one
constexpr double kSameExposure = 1e-3;          // a camera may round twice
/// A longer exposure is left alone where light, as the shorter ones measured it, brings it nearer
/// to full scale than so many standard deviations: of frames that are now and then saturated those
/// that are not are the darker ones.
constexpr double kSigmasBelowFull = 4;
/// Below this part of full scale no exposure is near saturation, whatever the shorter ones say.
constexpr double kFarFromFull = 0.5;
constexpr int kRounds = 3;  // of weights and light; they settle to 1e-3 of the noise in two

struct Exposure {
  const Picture* lit = nullptr;
  const Picture* dark = nullptr;
};

Status check_picture(const Picture& picture, const Picture& first, const char* what) {
  if (picture.counts.width() != first.counts.width() ||
      picture.counts.height() != first.counts.height()) {
    return fail(Errc::kInvalidOption,
                "merging exposures: a {} picture has {} x {} pixels, the first one {} x {}; all of "
                "a bracket have to be of one size",
                what,
                picture.counts.width(),
                picture.counts.height(),
                first.counts.width(),
                first.counts.height());
  }
  if (picture.full_scale != first.full_scale || picture.mosaic != first.mosaic) {
    return fail(Errc::kInvalidOption,
                "merging exposures: a {} picture has full scale {}, the first one {}, or another "
                "mosaic; take a bracket with one pixel format",
                what,
                picture.full_scale,
                first.full_scale);
  }
  if (!(picture.exposure_s > 0) || !std::isfinite(picture.exposure_s) || picture.frames < 1 ||
      !(picture.full_scale > 0) || !std::isfinite(picture.full_scale)) {
    return fail(Errc::kInvalidOption,
                "merging exposures: a {} picture has exposure {} s, {} frames, full scale {}; all "
                "have to be above 0",
                what,
                picture.exposure_s,
                picture.frames,
                picture.full_scale);
  }
  for (const Rgb32f& counts : picture.counts.pixels()) {
    if (!(counts.minCoeff() >= 0) || !counts.allFinite()) {
      return fail(Errc::kInvalidOption,
                  "merging exposures: a {} picture of {} s has a pixel of {}, {}, {} counts; they "
                  "have to be numbers from 0: the file is damaged, take it again",
                  what,
                  picture.exposure_s,
                  counts[0],
                  counts[1],
                  counts[2]);
    }
  }
  return {};
}

/// Pairs of a lit and its dark picture, shortest first.
Result<std::vector<Exposure>> pair_up(std::span<const Picture> lit, std::span<const Picture> dark) {
  if (lit.empty() || lit.front().counts.empty())
    return fail(Errc::kInvalidOption, "merging exposures: there is no picture");
  for (const Picture& picture : lit) VENEER_TRY(check_picture(picture, lit.front(), "lit"));
  for (const Picture& picture : dark) VENEER_TRY(check_picture(picture, lit.front(), "dark"));
  std::vector<Exposure> exposures;
  for (const Picture& picture : lit) {
    const auto own = std::ranges::find_if(dark, [&](const Picture& other) {
      return std::abs(other.exposure_s - picture.exposure_s) <= kSameExposure * picture.exposure_s;
    });
    if (own == dark.end()) {
      return fail(Errc::kInvalidOption,
                  "merging exposures: there is no dark picture of {} s; take one of each exposure "
                  "with the light covered",
                  picture.exposure_s);
    }
    exposures.push_back({&picture, &*own});
  }
  std::ranges::stable_sort(exposures, {}, [](const Exposure& e) { return e.lit->exposure_s; });
  return exposures;
}

/// One pixel's channel in one exposure.
struct Reading {
  double seconds = 0;
  double light = 0;       ///< above dark, in parts of what saturates, for this exposure
  double dark_light = 0;  ///< what dark alone makes, the same unit
  double dark_variance = 0;
  double lit_frames = 1;
  double fraction = 0;  ///< of full scale, as read
  bool full = false;    ///< saturated
  bool used = false;
};

class Merger {
 public:
  Merger(const ResponseCurve& response, const NoiseModel& noise, double full_scale)
      : response_(response), noise_(noise), full_scale_(full_scale) {}

  struct Merged {
    double light = 0;
    double variance = std::numeric_limits<double>::infinity();
    bool saturated = true;
  };

  [[nodiscard]] Reading read(const Exposure& exposure, int x, int y, int channel) const {
    Reading reading;
    const double counts = exposure.lit->counts(x, y)[channel];
    const double dark = exposure.dark->counts(x, y)[channel];
    reading.seconds = exposure.lit->exposure_s;
    reading.fraction = counts / full_scale_;
    // Frames are averaged: half a count below full scale is full scale, rounded in a file.
    reading.full = counts > full_scale_ - 0.5 || dark > full_scale_ - 0.5;
    reading.dark_light = response_.light(channel, dark / full_scale_);
    reading.light = response_.light(channel, reading.fraction) - reading.dark_light;
    reading.dark_variance =
        light_variance(channel, dark / full_scale_, noise_.variance(0) / exposure.dark->frames);
    reading.lit_frames = exposure.lit->frames;
    return reading;
  }

  /// @param readings  shortest first.
  [[nodiscard]] Merged merge(std::span<Reading> readings, int channel) const {
    Merged merged;
    for (Reading& reading : readings) {
      reading.used = !reading.full && (merged.saturated || reading.fraction < kFarFromFull ||
                                       stays_below_full(reading, merged, channel));

      if (reading.used) merged = combine(readings, merged, channel);
    }
    return merged;
  }

 private:
  static double square(double value) { return value * value; }

  /// Of light, from that of counts: through the response's mean slope over what noise covers.
  [[nodiscard]] double light_variance(int channel, double fraction, double counts_variance) const {
    const double sigma = std::sqrt(counts_variance) / full_scale_;
    const double low = std::max(0.0, fraction - sigma);
    const double high = std::min(1.0, fraction + sigma);
    return square(sigma * (response_.light(channel, high) - response_.light(channel, low)) /
                  (high - low));
  }
  /// Of one exposure's light per second, if the pixel sends `light_per_s`: that of its noise in
  /// counts there.
  [[nodiscard]] double variance(const Reading& reading, double light_per_s, int channel) const {
    const double light = std::max(light_per_s, 0.0) * reading.seconds + reading.dark_light;
    const double fraction = response_.counts_fraction(channel, light);
    const double dark = response_.counts_fraction(channel, reading.dark_light);
    const double lit_variance = light_variance(
        channel, fraction, noise_.variance((fraction - dark) * full_scale_) / reading.lit_frames);
    return (lit_variance + reading.dark_variance) / square(reading.seconds);
  }

  [[nodiscard]] bool stays_below_full(const Reading& reading,
                                      const Merged& shorter,
                                      int channel) const {
    const double expected = shorter.light * reading.seconds + reading.dark_light;
    // A single frame's noise decides whether one is saturated, not that of their mean.
    const double own = variance(reading, shorter.light, channel) * reading.lit_frames;
    const double sigma = std::sqrt(own + shorter.variance) * reading.seconds;
    return expected + kSigmasBelowFull * sigma < 1;
  }

  [[nodiscard]] Merged combine(std::span<const Reading> readings,
                               const Merged& before,
                               int channel) const {
    // Weights from light as it is merged: a single noisy count would favour what is too dark.
    double light = before.light;
    if (before.saturated) {
      for (const Reading& reading : readings)
        if (reading.used) light = reading.light / reading.seconds;
    }
    double weight_sum = 0;
    for (int round = 0; round < kRounds; ++round) {
      double sum = 0;
      weight_sum = 0;
      for (const Reading& reading : readings) {
        if (!reading.used) continue;
        const double weight = 1 / variance(reading, light, channel);
        sum += weight * reading.light / reading.seconds;
        weight_sum += weight;
      }
      light = sum / weight_sum;
    }
    return {.light = light, .variance = 1 / weight_sum, .saturated = false};
  }

  const ResponseCurve& response_;
  const NoiseModel& noise_;
  double full_scale_;
};

}  // namespace

double NoiseModel::variance(double counts) const {
  return read_noise_counts * read_noise_counts + kRoundingVariance +
         std::max(counts, 0.0) / electrons_per_count;
}

Result<MergedPicture> merge(std::span<const Picture> lit,
                            std::span<const Picture> dark,
                            const ResponseCurve& response,
                            const NoiseModel& noise) {
  VENEER_ASSIGN(const std::vector<Exposure> exposures, pair_up(lit, dark));
  if (!(noise.electrons_per_count > 0) || !std::isfinite(noise.electrons_per_count) ||
      !(noise.read_noise_counts >= 0) || !std::isfinite(noise.read_noise_counts)) {
    return fail(Errc::kInvalidOption,
                "merging exposures: the camera's noise is {} electrons a count and {} counts of "
                "reading; give finite numbers, the first above 0",
                noise.electrons_per_count,
                noise.read_noise_counts);
  }
  const Picture& first = lit.front();
  const int width = first.counts.width();
  const int height = first.counts.height();
  MergedPicture merged{.light = Image<Rgb32f>(width, height),
                       .variance = Image<Rgb32f>(width, height),
                       .saturated = Image<std::uint8_t>(width, height),
                       .mosaic = first.mosaic};
  const Merger merger(response, noise, first.full_scale);
  parallel_for(height, 8, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Reading> readings(exposures.size());
    for (int y = static_cast<int>(begin); y < end; ++y) {
      for (int x = 0; x < width; ++x) {
        for (int channel = 0; channel < 3; ++channel) {
          for (std::size_t i = 0; i < exposures.size(); ++i)
            readings[i] = merger.read(exposures[i], x, y, channel);
          const auto pixel = merger.merge(readings, channel);
          merged.light(x, y)[channel] = static_cast<float>(pixel.light);
          merged.variance(x, y)[channel] = static_cast<float>(pixel.variance);
          if (pixel.saturated) merged.saturated(x, y) |= static_cast<std::uint8_t>(1U << channel);
        }
      }
    }
  });
  const auto saturated =
      std::ranges::count_if(merged.saturated.pixels(), [](std::uint8_t bits) { return bits != 0; });
  merged.saturated_fraction =
      static_cast<double>(saturated) / static_cast<double>(merged.saturated.pixels().size());
  return merged;
}

}  // namespace veneer::capture
