// SPDX-License-Identifier: Apache-2.0
#include "capture/development/sample_set.h"

#include <algorithm>
#include <cstddef>

#include "btf/sample_set.h"

namespace veneer::capture {
namespace {

/// The mean of the unmasked texels in the smallest square around (x, y) that has any.
Rgb32f around(const Image<Rgb32f>& image, const Image<std::uint8_t>& masked, int x, int y) {
  for (int reach = 1; reach < std::max(image.width(), image.height()); ++reach) {
    Rgb32f sum = Rgb32f::Zero();
    int count = 0;
    for (int v = std::max(0, y - reach); v <= std::min(image.height() - 1, y + reach); ++v) {
      for (int u = std::max(0, x - reach); u <= std::min(image.width() - 1, x + reach); ++u) {
        if (masked(u, v) != 0) continue;
        sum += image(u, v);
        ++count;
      }
    }
    if (count > 0) return sum / static_cast<float>(count);
  }
  return Rgb32f::Zero();
}

}  // namespace

Result<DevelopedSet> write_sample_set(const Developer& developer,
                                      const std::filesystem::path& path,
                                      const SetOptions& options,
                                      const DirectionSink& sink,
                                      Progress& progress) {
  const CapturePlan& plan = developer.plan();
  const RigFindings& rig = developer.findings();
  btf::SampleSetInfo info;
  info.width = plan.area.columns;
  info.height = plan.area.rows;
  info.texel_pitch_mm = plan.area.width_mm / plan.area.columns;
  info.polarised = true;
  info.views = rig.views;
  info.lights = rig.lights;
  info.source = plan.name.empty() ? "a capture session" : "a capture session: " + plan.name;
  VENEER_ASSIGN(btf::SampleSetWriter writer, btf::SampleSetWriter::create(path, info));

  const auto views = static_cast<int>(rig.views.size());
  const auto lights = static_cast<int>(rig.lights.size());
  DevelopedSet set;
  std::string masked_where;
  double masked = 0;
  progress.start("developing", std::int64_t{views} * lights);
  for (int view = 0; view < views; ++view) {
    for (int light = 0; light < lights; ++light) {
      VENEER_ASSIGN(const DevelopedDirection direction, developer.develop(view, light));
      VENEER_TRY(sink(direction));
      set.directions.push_back(direction.findings);
      set.specular_negative += direction.findings.specular_negative;
      set.diffuse_negative += direction.findings.diffuse_negative;
      if (direction.findings.masked_fraction > 0) {
        masked += direction.findings.masked_fraction;
        masked_where += fmt::format("{}view {} light {} ({:.2g} %)",
                                    masked_where.empty() ? "" : ", ",
                                    view,
                                    light,
                                    100 * direction.findings.masked_fraction);
      }
      const auto pair = static_cast<std::size_t>(view * lights + light) * 6;
      for (int y = 0; y < info.height; ++y) {
        for (int x = 0; x < info.width; ++x) {
          const bool known = direction.masked(x, y) == 0;
          const std::span<Eigen::half> texel = writer.texel(y * info.width + x);
          const auto put = [&](const Image<Rgb32f>& part, std::size_t first) {
            const Rgb32f value = known ? part(x, y) : around(part, direction.masked, x, y);
            for (std::size_t c = 0; c < 3; ++c) {
              const float sample = value[static_cast<Eigen::Index>(c)];
              set.light_added += std::max(0.0F, -sample);
              texel[pair + first + c] = writer.stored(std::max(0.0F, sample));
            }
          };
          put(direction.specular, 0);
          put(direction.diffuse, 3);
        }
      }
      progress.advance();
    }
  }
  const double pairs = static_cast<double>(views) * lights;
  set.masked_fraction = masked / pairs;
  set.specular_negative /= pairs;
  set.diffuse_negative /= pairs;
  set.light_added /= pairs * info.texel_count() * info.channel_count();
  if (masked > 0 && !options.fill_masked)
    return fail(
        Errc::kBadFormat,
        "developing {}: texels were saturated in every exposure, and nobody knows how bright "
        "they are: {}. Capture these again with a shorter exposure, or pass --fill-masked "
        "to take their neighbours' light",
        path.string(),
        masked_where);
  VENEER_TRY(writer.finish());
  const std::string clamped = writer.clamped_remark();
  progress.finish(fmt::format(
      "{:.2g} % masked{}{}", 100 * set.masked_fraction, clamped.empty() ? "" : "; ", clamped));
  return set;
}

}  // namespace veneer::capture
