// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/brdf.h"

#include <numbers>

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
  VENEER_ASSIGN(SampleSetWriter writer, SampleSetWriter::create(set, info));
  const std::span<Eigen::half> out = writer.texel(0);
  std::size_t i = 0;
  for (const Direction& view : info.views) {
    for (const Direction& light : info.lights) {
      const Eigen::Vector3d reflected = brdf(view, light);
      for (const double value : reflected) {
        const Eigen::half sample(static_cast<float>(std::numbers::pi * value));
        if (!(Eigen::numext::isfinite)(sample))
          return fail(Errc::kBadFormat,
                      "{}: the value {} for view {} and light {} is none that a sample can take",
                      doing,
                      value,
                      i / 3 / info.lights.size(),
                      i / 3 % info.lights.size());
        out[i++] = sample;
      }
    }
  }
  return writer.finish();
}

}  // namespace veneer::btf
