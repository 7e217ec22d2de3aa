// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/synthesize.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "btf/sample_set.h"
#include "simulation/materials/internal_materials.h"
#include "simulation/materials/tracer.h"

namespace veneer::simulation {

namespace {

constexpr std::array kMaterials{
    HeightFieldMaterial{"cloth", "twill of two thread colours with a satin gloss", &make_cloth},
    HeightFieldMaterial{
        "corrugated", "corrugated sheet with gloss (Obara et al. 2006)", &make_corrugated},
    HeightFieldMaterial{
        "corrugated-print", "the same sheet with a print of all hues", &make_corrugated_print},
    HeightFieldMaterial{
        "hammered", "hammered copper: tinted gloss, hardly any body colour", &make_hammered},
    HeightFieldMaterial{"leather", "pressed brown leather under a clear coat", &make_leather},
    HeightFieldMaterial{"plaster", "dry lime plaster, matte", &make_plaster},
};
static_assert(std::ranges::is_sorted(kMaterials, {}, &HeightFieldMaterial::name));

// What a set of a tile says of itself.
btf::SampleSetInfo info_of(std::string_view name,
                           double tile_width_mm,
                           const SynthesisOptions& options) {
  btf::SampleSetInfo info;
  info.width = options.size;
  info.height = options.size;
  info.texel_pitch_mm = tile_width_mm / options.size;
  info.polarised = true;
  info.views = options.views;
  info.lights = options.lights;
  info.source = fmt::format("veneer synthesize {}: size {}, samples {}, bounces {}, seed {}",
                            name,
                            options.size,
                            options.samples,
                            options.bounces,
                            options.seed);
  info.licence = "computed from formulas; free of rights";
  return info;
}

Status write_traced(const Tracer& tracer,
                    std::string_view name,
                    const SynthesisOptions& options,
                    btf::SampleSetWriter& writer,
                    Progress& progress) {
  const std::size_t values = options.views.size() * options.lights.size() * 6;
  progress.start(fmt::format("tracing {}", name), options.size);
  parallel_for(options.size, 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> samples(values);
    for (auto row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < options.size; ++column) {
        const int texel = row * options.size + column;
        tracer.trace(texel, samples);
        std::ranges::transform(samples, writer.texel(texel).begin(), [&](float sample) {
          return writer.stored(sample);
        });
      }
      progress.advance();
    }
  });
  progress.finish(writer.clamped_remark());
  return writer.finish();
}

// @param tracer_of  Tracer(field), of what the material makes
template <class Material, class TracerOf>
Status synthesize_with(const Material& material,
                       const std::filesystem::path& out,
                       const SynthesisOptions& options,
                       Progress& progress,
                       const TracerOf& tracer_of) {
  VENEER_TRY(options.check());
  const auto field = material.make(options.size, options.seed);
  VENEER_TRY(field.check());
  VENEER_ASSIGN(
      btf::SampleSetWriter writer,
      btf::SampleSetWriter::create(out, info_of(material.name, field.tile_width_mm, options)));
  return write_traced(tracer_of(field), material.name, options, writer, progress);
}

}  // namespace

std::span<const HeightFieldMaterial> height_field_materials() { return kMaterials; }

Result<const HeightFieldMaterial*> find_height_field_material(std::string_view name) {
  const auto* const found = std::ranges::find(kMaterials, name, &HeightFieldMaterial::name);
  if (found != kMaterials.end()) return found;
  std::string names;
  for (const auto& material : kMaterials) {
    names += names.empty() ? "" : ", ";
    names += material.name;
  }
  return fail(
      Errc::kInvalidOption, "looking for a material: there is no '{}'; there are {}", name, names);
}

Status synthesize(const HeightFieldMaterial& material,
                  const std::filesystem::path& out,
                  const SynthesisOptions& options,
                  Progress& progress) {
  return synthesize_with(material, out, options, progress, [&](const HeightField& field) {
    return Tracer(field, options, progress);
  });
}

Status synthesize(const BodyMaterial& material,
                  const std::filesystem::path& out,
                  const SynthesisOptions& options,
                  Progress& progress) {
  return synthesize_with(material, out, options, progress, [&](const BodyField& field) {
    return Tracer(field, options);
  });
}

}  // namespace veneer::simulation
