// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/brdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "btf/importers/crop.h"

namespace veneer::btf {

Result<DirectionSet> direction_grid(const ImportOptions& options) {
  if (options.directions == "bonn81") return bonn_directions();
  if (options.directions == "ubo151") return ubo2014_directions();
  return fail(Errc::kInvalidOption,
              "there are no directions \"{}\"; there are: bonn81 ubo151",
              options.directions);
}

Status write_brdf(const std::filesystem::path& file,
                  const std::filesystem::path& set,
                  const ImportOptions& options,
                  const std::string& source,
                  const std::string& licence,
                  const ReflectedLight& brdf) {
  const std::string doing = fmt::format("importing {}", file.string());
  VENEER_TRY(crop_of(options, 1, 1, doing));
  SampleSetInfo info;
  info.width = 1;
  info.height = 1;
  VENEER_ASSIGN(info.views, direction_grid(options));
  info.lights = info.views;
  info.source = source;
  info.licence = licence;
  // All before the first is written: they choose the scale.
  std::vector<float> samples;
  float largest = 0.0F;
  for (const Direction& view : info.views) {
    for (const Direction& light : info.lights) {
      const Eigen::Vector3d reflected = brdf(view, light);
      for (const double value : reflected) {
        const auto sample = static_cast<float>(std::numbers::pi * value);
        if (!(std::abs(sample) <= static_cast<float>(kMostScale)))
          return fail(Errc::kBadFormat,
                      "{}: the value {} for view {} and light {} is none that a sample can take",
                      doing,
                      value,
                      samples.size() / 3 / info.lights.size(),
                      samples.size() / 3 % info.lights.size());
        largest = std::max(largest, sample);
        samples.push_back(sample);
      }
    }
  }
  info.scale = scale_for(static_cast<double>(largest));
  VENEER_ASSIGN(SampleSetWriter writer, SampleSetWriter::create(set, info));
  std::ranges::transform(
      samples, writer.texel(0).begin(), [&writer](float sample) { return writer.stored(sample); });
  return writer.finish();
}

}  // namespace veneer::btf
