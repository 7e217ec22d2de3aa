// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/phong_texture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "btf/sample_set.h"
#include "simulation/materials/internal_noise.h"

namespace veneer::simulation {

namespace {

constexpr double kTileWidthMm = 32.0;

// Smooth noise of many sizes, brought to [0, 1].
double share(double x, double y, std::uint64_t seed) {
  return std::clamp(0.5 + 0.5 * cloud_noise(x, y, 6, 3, seed), 0.0, 1.0);
}

double between(double low, double high, double share) { return low + (high - low) * share; }

bool above(const btf::Direction& view, const btf::Direction& light) {
  return view.z() > 0.0 && light.z() > 0.0;
}

}  // namespace

Eigen::Vector3d PhongPoint::diffuse_sample(const btf::Direction& view,
                                           const btf::Direction& light) const {
  return above(view, light) ? Eigen::Vector3d(light.z() * diffuse) : Eigen::Vector3d::Zero();
}

double PhongPoint::specular_sample(const btf::Direction& view, const btf::Direction& light) const {
  if (!above(view, light)) return 0.0;
  const btf::Direction mirrored(-light.x(), -light.y(), light.z());
  const double cosine = std::max(0.0, mirrored.dot(view));
  return 0.5 * strength * (exponent + 2.0) * std::pow(cosine, exponent) * light.z();
}

PhongPoint phong_texture(double x, double y, std::uint64_t seed) {
  // One noise for each channel, so that hue, saturation and brightness all wander.
  PhongPoint point;
  for (int c = 0; c < 3; ++c)
    point.diffuse[c] = between(0.03, 0.8, share(x, y, seed + 10 * static_cast<unsigned>(c)));
  point.strength = between(0.02, 0.18, share(x, y, seed + 40));
  point.exponent = between(6.0, 40.0, share(x, y, seed + 50));
  return point;
}

Status synthesize_phong(const std::filesystem::path& out,
                        const SynthesisOptions& options,
                        Progress& progress) {
  VENEER_TRY(options.check());
  btf::SampleSetInfo info;
  info.width = options.size;
  info.height = options.size;
  info.texel_pitch_mm = kTileWidthMm / options.size;
  info.polarised = true;
  info.views = options.views;
  info.lights = options.lights;
  info.source =
      fmt::format("veneer synthesize phong: size {}, seed {}", options.size, options.seed);
  info.licence = "computed from formulas; free of rights";
  VENEER_ASSIGN(btf::SampleSetWriter writer, btf::SampleSetWriter::create(out, info));

  progress.start("computing phong", options.size);
  parallel_for(options.size, 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < options.size; ++column) {
        const PhongPoint point =
            phong_texture((column + 0.5) / options.size, (row + 0.5) / options.size, options.seed);
        auto sample = writer.texel(row * options.size + column).begin();
        for (const btf::Direction& view : options.views) {
          for (const btf::Direction& light : options.lights) {
            sample = std::fill_n(
                sample, 3, static_cast<Eigen::half>(point.specular_sample(view, light)));
            const Eigen::Vector3d diffuse = point.diffuse_sample(view, light);
            sample = std::transform(diffuse.begin(), diffuse.end(), sample, [](double value) {
              return static_cast<Eigen::half>(value);
            });
          }
        }
      }
      progress.advance();
    }
  });
  progress.finish();
  return writer.finish();
}

}  // namespace veneer::simulation
