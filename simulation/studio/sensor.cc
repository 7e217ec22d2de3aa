// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/sensor.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "base/random.h"

namespace veneer::simulation::studio {
namespace {

// What is drawn at random, each in a sequence of its own.
constexpr std::uint64_t kDeviateStream = 1;
constexpr std::uint64_t kGainStream = 2;
constexpr std::uint64_t kOffsetStream = 3;
constexpr std::uint64_t kFirstRowStream = 16;

constexpr double kOffsetPattern = 0.1;  // standard deviation, of the offset

/// Normal deviates, symmetric and of deviation 1, to be picked from at random: a picture takes a
/// million of them.
std::vector<float> normal_deviates(std::uint64_t seed) {
  constexpr std::size_t kHalf = 1 << 15;
  Pcg32 random(seed, kDeviateStream);
  std::vector<double> half(kHalf);
  double squares = 0;
  for (double& value : half) {
    value = random.normal();
    squares += value * value;
  }
  const double scale = std::sqrt(kHalf / squares);
  std::vector<float> deviates;
  for (const double value : half)
    for (const double sign : {-1.0, 1.0})
      deviates.push_back(static_cast<float>(sign * scale * value));
  return deviates;
}

}  // namespace

StudioSensor::StudioSensor(const StudioTruth& truth)
    : truth_(truth), deviates_(normal_deviates(truth.seed)) {
  const auto channels =
      static_cast<std::size_t>(truth.width) * static_cast<std::size_t>(truth.height) * 3;
  Pcg32 gain_random(truth.seed, kGainStream);
  Pcg32 offset_random(truth.seed, kOffsetStream);
  const auto deviate = [this](Pcg32& random) { return deviates_[random.next() >> 16U]; };
  gains_.reserve(channels);
  offsets_.reserve(channels);
  for (std::size_t i = 0; i < channels; ++i) {
    gains_.push_back(1 + static_cast<float>(truth.fixed_pattern) * deviate(gain_random));
    offsets_.push_back(
        std::max(0.0F,
                 static_cast<float>(truth.offset_counts) *
                     (1 + static_cast<float>(kOffsetPattern) * deviate(offset_random))));
  }
}

std::uint16_t StudioSensor::full_scale() const {
  return static_cast<std::uint16_t>((1U << static_cast<unsigned>(truth_.bits)) - 1);
}

double StudioSensor::electrons(double light, double exposure_s) const {
  return (light * truth_.full_well / kFill_s + truth_.dark_current) * exposure_s;
}

Image<Rgb16> StudioSensor::expose(const Image<Rgb32f>& light,
                                  double exposure_s,
                                  double gain,
                                  std::uint64_t number) const {
  const auto full_well = static_cast<float>(truth_.full_well);
  const auto dark = static_cast<float>(electrons(0, exposure_s));
  const auto electrons_per_light = static_cast<float>(electrons(1, exposure_s)) - dark;
  const auto read_noise = static_cast<float>(truth_.read_noise);
  const auto scale = static_cast<float>(full_scale());
  const auto counts_per_electron =
      static_cast<float>(gain * scale / (kConverterReach * truth_.full_well));
  const auto exponent = static_cast<float>(1 / truth_.response_gamma);
  const auto width = static_cast<std::size_t>(light.width());
  const int channels = truth_.mosaic ? 1 : 3;
  Image<Rgb16> picture(light.width(), light.height());
  parallel_for(light.height(), 16, [&](std::int64_t begin, std::int64_t end) {
    for (auto y = static_cast<std::size_t>(begin); y < static_cast<std::size_t>(end); ++y) {
      Pcg32 random(truth_.seed,
                   kFirstRowStream + number * static_cast<std::uint64_t>(light.height()) + y);
      for (std::size_t pixel = y * width; pixel < (y + 1) * width; ++pixel)
        for (int c = 0; c < channels; ++c) {
          const auto channel = static_cast<std::size_t>(c);
          const float mean =
              electrons_per_light * light.pixels()[pixel][c] * gains_[3 * pixel + channel] + dark;
          const float deviate = deviates_[random.next() >> 16U];
          float got = 0;
          if (mean < PoissonDeviates::kMost) {
            got = static_cast<float>(poisson_.draw(mean, random)) + read_noise * deviate;
          } else if (mean < full_well) {
            // Two independent normal deviates add up to one.
            got = mean + std::sqrt(mean + read_noise * read_noise) * deviate;
          } else {
            got = full_well + read_noise * deviate;
          }
          // The converter takes what is in the well and its offset; a response curve comes last.
          float counts =
              std::clamp(got * counts_per_electron + offsets_[3 * pixel + channel], 0.0F, scale);
          if (exponent != 1) counts = scale * std::pow(counts / scale, exponent);
          picture.pixels()[pixel][channel] = static_cast<std::uint16_t>(std::rint(counts));
        }
      if (channels == 1)
        for (std::size_t pixel = y * width; pixel < (y + 1) * width; ++pixel)
          picture.pixels()[pixel].fill(picture.pixels()[pixel][0]);
    }
  });
  return picture;
}

}  // namespace veneer::simulation::studio
