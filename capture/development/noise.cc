// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "base/statistics.h"
#include "capture/development/hdr_merge.h"

namespace veneer::capture {
namespace {

constexpr int kBins = 48;                ///< of equal population, along the means
constexpr std::size_t kLeastInBin = 50;  ///< fewer say no variance
/// Near saturation the darker frames are left over and the variance falls.
constexpr double kMostOfFullScale = 0.9;
constexpr double kClipSigmas = 5;          ///< what is further off is no noise: a lamp, a movement
constexpr double kSlopeSignificance = 10;  ///< of the slope, in its standard errors
constexpr double kRoundingVariance = 1.0 / 12;

/// What a pair of pictures says of the noise at one level of light.
struct Level {
  double counts = 0;    ///< above dark
  double variance = 0;  ///< of one frame
  double samples = 0;
};

/// Are they repeats of one scene? Dark ones are whatever the light.
bool repeats(const Picture& a, const Picture& b) {
  if (a.exposure_s != b.exposure_s || a.full_scale != b.full_scale || a.frames != b.frames ||
      a.counts.width() != b.counts.width() || a.counts.height() != b.counts.height())
    return false;
  if (a.shot.dark && b.shot.dark)
    return a.shot.target == b.shot.target && a.shot.view == b.shot.view &&
           a.shot.analyser == b.shot.analyser;
  Shot first = a.shot;
  first.repeat = b.shot.repeat;
  return first == b.shot;
}

double median_counts(const Picture& picture) {
  std::vector<double> counts;
  counts.reserve(picture.counts.pixels().size());
  for (const Rgb32f& pixel : picture.counts.pixels()) counts.push_back(pixel.mean());
  return quantile(std::move(counts), 0.5);
}

/// The dark level: that of the dark picture whose exposure is nearest; 0 without one.
double offset_for(const Picture& picture, std::span<const Picture> pictures) {
  const Picture* nearest = nullptr;
  const auto distance = [&](const Picture& dark) {
    return std::abs(std::log(dark.exposure_s / picture.exposure_s));
  };
  for (const Picture& other : pictures)
    if (other.shot.dark && (!nearest || distance(other) < distance(*nearest))) nearest = &other;
  return nearest ? median_counts(*nearest) : 0.0;
}

struct Sample {
  double mean, difference;
};

/// Variance about the median, without what is far from it.
Level level_of(std::span<const Sample> samples, double frames) {
  std::vector<double> differences;
  Level level;
  for (const Sample& sample : samples) {
    differences.push_back(sample.difference);
    level.counts += sample.mean / static_cast<double>(samples.size());
  }
  const double middle = quantile(differences, 0.5);
  std::vector<double> off;
  for (const double difference : differences) off.push_back(std::abs(difference - middle));
  // Whole counts make a median of 0 where noise is small: half a count more is let in.
  const double limit = kClipSigmas * (1.4826 * quantile(off, 0.5) + 0.5 / std::sqrt(frames));
  double sum = 0;
  double squares = 0;
  for (const double difference : differences) {
    if (!(std::abs(difference - middle) <= limit)) continue;
    sum += difference - middle;
    squares += (difference - middle) * (difference - middle);
    ++level.samples;
  }
  const double mean = sum / level.samples;
  level.variance =
      (squares / level.samples - mean * mean) * level.samples / (level.samples - 1) * frames / 2;
  return level;
}

void add_levels(const Picture& a, const Picture& b, double offset, std::vector<Level>& levels) {
  std::vector<Sample> samples;
  for (std::size_t i = 0; i < a.counts.pixels().size(); ++i) {
    for (int channel = 0; channel < 3; ++channel) {
      const double first = a.counts.pixels()[i][channel];
      const double second = b.counts.pixels()[i][channel];
      if (!std::isfinite(first) || !std::isfinite(second) ||
          std::max(first, second) > kMostOfFullScale * a.full_scale)
        continue;
      samples.push_back({(first + second) / 2 - offset, first - second});
    }
  }
  std::ranges::sort(samples, {}, &Sample::mean);
  const std::size_t in_bin = std::max(kLeastInBin, samples.size() / kBins);
  for (std::size_t begin = 0; begin + in_bin <= samples.size(); begin += in_bin)
    levels.push_back(level_of(std::span(samples).subspan(begin, in_bin), a.frames));
}

/// variance = intercept + slope counts
struct Line {
  double intercept = 0, slope = 0, slope_sigma = std::numeric_limits<double>::infinity();
};

/// Weighted by what a variance of so many samples is known to, which is in parts of itself: of the
/// line, so that a level that came out low by chance does not count for more.
Line fit_line(const std::vector<Level>& levels) {
  Line line{.intercept = mean([&] {
              std::vector<double> variances;
              for (const Level& level : levels) variances.push_back(level.variance);
              return variances;
            }())};
  const double floor = 1e-3 * line.intercept + 1e-12;
  for (int round = 0; round < 10; ++round) {
    double w = 0, x = 0, y = 0, xx = 0, xy = 0;
    for (const Level& level : levels) {
      const double expected =
          std::max(floor, line.intercept + line.slope * std::max(level.counts, 0.0));
      const double weight = level.samples / (2 * expected * expected);
      w += weight;
      x += weight * level.counts;
      y += weight * level.variance;
      xx += weight * level.counts * level.counts;
      xy += weight * level.counts * level.variance;
    }
    const double determinant = w * xx - x * x;
    if (!(determinant > 1e-12 * w * xx)) return {};
    line.slope = (w * xy - x * y) / determinant;
    line.intercept = (y - line.slope * x) / w;
    line.slope_sigma = std::sqrt(w / determinant);
  }
  return line;
}

}  // namespace

Result<NoiseModel> measure_noise(std::span<const Picture> pictures) {
  std::vector<Level> levels;
  int pairs = 0;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    // Each with the next of its kind: no difference is counted twice.
    for (std::size_t j = i + 1; j < pictures.size(); ++j) {
      if (!repeats(pictures[i], pictures[j]) || !(pictures[i].exposure_s > 0) ||
          pictures[i].frames < 1 || !(pictures[i].full_scale > 0))
        continue;
      add_levels(pictures[i], pictures[j], offset_for(pictures[i], pictures), levels);
      ++pairs;
      break;
    }
  }
  if (pairs == 0) {
    return fail(Errc::kInvalidOption,
                "measuring the camera's noise: of {} pictures no two repeat one exposure of one "
                "scene; take each twice",
                pictures.size());
  }
  const Line line = levels.size() < 3 ? Line{} : fit_line(levels);
  if (!(line.slope > kSlopeSignificance * line.slope_sigma)) {
    return fail(Errc::kBadFormat,
                "measuring the camera's noise: over the {} levels of light in {} pairs it does not "
                "grow with light; take a scene that has dark and bright parts, below saturation",
                levels.size(),
                pairs);
  }
  return NoiseModel{
      .electrons_per_count = 1 / line.slope,
      .read_noise_counts = std::sqrt(std::max(0.0, line.intercept - kRoundingVariance))};
}

}  // namespace veneer::capture
