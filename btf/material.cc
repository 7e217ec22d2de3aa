// SPDX-License-Identifier: Apache-2.0
#include "btf/material.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "btf/mapped_material.h"
#include "btf/models/components.h"
#include "btf/models/dichromatic_lpca/dichromatic_lpca.h"
#include "btf/models/eigen_texture/eigen_texture.h"
#include "btf/models/lafortune/lafortune.h"
#include "btf/models/layered/layered.h"
#include "btf/models/lpca/lpca.h"
#include "btf/models/phong/phong.h"
#include "btf/models/reflectance_field/reflectance_field.h"
#include "btf/models/revised_lpca/revised_lpca.h"
#include "btf/models/scaled_lafortune/scaled_lafortune.h"
#include "btf/models/texel_colours/texel_colours.h"
#include "btf/scaled_material.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kFormat = "veneer-material";
constexpr std::string_view kVersion = "1";

// Of the set's numbers as they are stored: 1 where factors in float16 have room above and below
// them, else the power of two that brings the largest to 1 to 2.
double range_of(const SampleSet& set, Communicator& ranks) {
  constexpr double kLeast = 1.0 / 256.0;
  constexpr double kMost = 1024.0;
  const RowRange own = rows_of_rank(set.info().texel_count(), ranks);
  const std::array largest{set.largest_stored(own.first, own.count)};
  const double most = std::ranges::max(gather<double>(ranks, largest));
  if (most == 0.0 || (most >= kLeast && most <= kMost)) return 1.0;
  return std::ldexp(1.0, std::ilogb(most));
}

// Models fit numbers that suit float16, whatever the set's scale is; what they were divided by goes
// around the material.
template <auto fit>
Result<std::unique_ptr<Material>> fit_scaled(const SampleSet& set,
                                             const FitOptions& options,
                                             Progress& progress) {
  VENEER_TRY(options.check());
  const double range = range_of(set, *options.ranks);
  VENEER_ASSIGN(auto material, fit(set.with_scale(1.0 / range), options, progress));
  return with_scale(std::move(material), range * set.info().scale);
}

template <auto load>
Result<std::unique_ptr<Material>> load_scaled(const SafetensorsFile& file) {
  VENEER_ASSIGN(const double scale, read_scale(file));
  VENEER_ASSIGN(auto material, load(file));
  return with_scale(std::move(material), scale);
}

// One line for each model.
constexpr std::array kModels{
    Model{"dichromatic-lpca",
          "shading times body colour plus specular times light colour (Obara et al. 2006)",
          2,
          true,
          &fit_scaled<&fit_dichromatic_lpca>,
          &load_scaled<&load_dichromatic_lpca>,
          true},
    Model{"eigen-texture",
          "pictures of every view, mixed by directions alone (Sattler et al. 2003)",
          1,
          false,
          &fit_scaled<&fit_eigen_texture>,
          &load_scaled<&load_eigen_texture>},
    Model{"lafortune",
          "Lafortune lobes under one specular colour (McAllister et al. 2002)",
          0,
          false,
          &fit_scaled<&fit_lafortune>,
          &load_scaled<&load_lafortune>},
    Model{"layered",
          "semi-transparent layers at several heights (Magda and Kriegman 2005)",
          0,
          false,
          &fit_scaled<&fit_layered>,
          &load_scaled<&load_layered>},
    Model{"lpca",
          "RGB Eigen-BRDFs of texel clusters, nine-fold interpolation (Mueller et al. 2003)",
          1,
          false,
          &fit_scaled<&fit_lpca>,
          &load_scaled<&load_lpca>,
          true},
    Model{"phong",
          "a diffuse colour and a white highlight about the mirror direction (Phong 1975)",
          0,
          false,
          &fit_scaled<&fit_phong>,
          &load_scaled<&load_phong>},
    Model{"reflectance-field",
          "for each measured view lobes in the light direction (Meseth et al. 2003)",
          0,
          false,
          &fit_scaled<&fit_reflectance_field>,
          &load_scaled<&load_reflectance_field>},
    Model{"revised-lpca",
          "RGB Eigen-BRDFs in a volume that the hardware interpolates (Schneider 2004)",
          1,
          false,
          &fit_scaled<&fit_revised_lpca>,
          &load_scaled<&load_revised_lpca>,
          true},
    Model{"scaled-lafortune",
          "Lafortune lobes times a colour for each view (Daubert et al. 2001)",
          0,
          false,
          &fit_scaled<&fit_scaled_lafortune>,
          &load_scaled<&load_scaled_lafortune>},
    Model{"texel-colours",
          "two learned colours a texel, scalar Eigen-BRDFs four to a volume (after Schneider 2004)",
          2,
          false,
          &fit_scaled<&fit_texel_colours>,
          &load_scaled<&load_texel_colours>,
          true},
};
static_assert(std::ranges::is_sorted(kModels, {}, &Model::name));

Status check_range(std::string_view name, int value, int least, int most) {
  if (value >= least && value <= most) return {};
  return fail(Errc::kInvalidOption, "fit: {} is {}; it must be {} to {}", name, value, least, most);
}

}  // namespace

Status FitOptions::check() const {
  constexpr int kMostClusters = 256;  // a texel stores its cluster in 8 bits
  VENEER_TRY(check_range("clusters", clusters, 1, kMostClusters));
  VENEER_TRY(check_range("angular", angular, kLeastAngular, kMostAngular));
  VENEER_TRY(check_range("lobes", lobes, 1, kMostLobes));
  VENEER_TRY(check_range("layers", layers, 0, LayerStack::kMostLayers));
  constexpr double kMostHeight = LayerStack::kMostHeight;
  if (heights && !(heights->lowest >= -kMostHeight && heights->highest <= kMostHeight &&
                   (heights->lowest < heights->highest ||
                    (layers == 1 && heights->lowest == heights->highest))))
    return fail(Errc::kInvalidOption,
                "heights are {} to {}; the lowest should be below the highest, both within {} "
                "texels of the reference plane",
                heights->lowest,
                heights->highest,
                kMostHeight);
  VENEER_TRY(check_range("mip_levels", mip_levels, 1, 15));
  VENEER_TRY(check_range("basis", basis, 0, 4096));
  VENEER_TRY(check_range("iterations", iterations, 1, 10000));
  VENEER_TRY(parse_components(components));
  return {};
}

std::span<const Model> models() { return kModels; }

Result<const Model*> find_model(std::string_view name) {
  const auto found = std::ranges::find(kModels, name, &Model::name);
  if (found != kModels.end()) return &*found;
  std::string names;
  for (const Model& model : kModels)
    names += fmt::format("{}{}", names.empty() ? "" : ", ", model.name);
  return fail(Errc::kInvalidOption, "there is no model \"{}\"; the models are {}", name, names);
}

Eigen::Vector3d Material::radiance_on(const TexelMap& map,
                                      int place,
                                      const Direction& view,
                                      const Direction& light) const {
  return radiance(map.source_texel(place), view, light);
}

void Material::reconstruct_on(const TexelMap& map, int place, std::span<float> rgb) const {
  reconstruct(map.source_texel(place), rgb);
}

Status save_material(const Material& material,
                     const std::filesystem::path& path,
                     const std::map<std::string, std::string>& provenance) {
  Material::Contents contents = material.contents();
  // Wide elements first: then every tensor is aligned whatever the sizes.
  std::ranges::stable_sort(contents.tensors, std::greater{}, [](const auto& tensor) {
    return size_of(tensor.spec.dtype);
  });
  std::map<std::string, std::string> metadata = provenance;
  for (const auto& [key, value] : contents.metadata) metadata[key] = value;
  metadata["format"] = kFormat;
  metadata["version"] = kVersion;
  metadata["model"] = material.model();
  std::vector<TensorSpec> specs;
  for (const auto& tensor : contents.tensors) specs.push_back(tensor.spec);
  VENEER_ASSIGN(SafetensorsWriter writer, SafetensorsWriter::create(path, specs, metadata));
  for (const auto& [spec, bytes] : contents.tensors) {
    const auto copy = [&writer, &name = spec.name, source = bytes]<class T>(T) {
      const std::span<T> target = writer.tensor<T>(name);
      VENEER_CHECK(target.size_bytes() == source.size());
      std::ranges::copy(source, std::as_writable_bytes(target).begin());
    };
    switch (spec.dtype) {
      case DType::kU8:
        copy(std::uint8_t{});
        break;
      case DType::kU16:
        copy(std::uint16_t{});
        break;
      case DType::kI32:
        copy(std::int32_t{});
        break;
      case DType::kF16:
        copy(Eigen::half{});
        break;
      case DType::kF32:
        copy(float{});
        break;
      case DType::kF64:
        copy(double{});
        break;
    }
  }
  return writer.finish();
}

Result<std::unique_ptr<Material>> load_material(const std::filesystem::path& path) {
  VENEER_ASSIGN(const SafetensorsFile file, SafetensorsFile::open(path));
  const auto& metadata = file.metadata();
  const auto format = metadata.find("format");
  if (format == metadata.end() || format->second != kFormat)
    return fail(Errc::kBadFormat,
                "reading {}: it holds no Veneer material; make one with veneer fit",
                path.string());
  VENEER_ASSIGN(const std::string version, file.meta("version"));
  if (version != kVersion)
    return fail(Errc::kBadFormat,
                "reading {}: it is a material of version {}; this program reads version {}",
                path.string(),
                version,
                kVersion);
  VENEER_ASSIGN(const std::string name, file.meta("model"));
  const auto model = find_model(name);
  if (!model) return fail(Errc::kBadFormat, "reading {}: {}", path.string(), model.error().what);
  VENEER_ASSIGN(std::unique_ptr<Material> material, (*model)->load(file));
  VENEER_ASSIGN(std::optional<TexelMap> map, read_texel_map(file, *material));
  if (!map) return material;
  auto mapped = with_texel_map(std::move(material), std::move(*map));
  if (!mapped) return fail(Errc::kBadFormat, "reading {}: {}", path.string(), mapped.error().what);
  return mapped;
}

}  // namespace veneer::btf
