// SPDX-License-Identifier: Apache-2.0
#include "btf/models/lobes/lafortune_lobes.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "base/parallel.h"

namespace veneer::btf {
namespace {

// Measured on 16 x 16 texels of the Bonn wallpaper, 2 lobes: powers 0, 0.3, 0.5, 0.8 leave an
// encoded epsilon of .0390, .0380, .0379, .0392 and a linear rmse of .0370, .0379, .0393, .0429.
constexpr float kWeightPower = 0.3F;
constexpr float kWeightFloor = 0.02F;
constexpr std::size_t kChannels = 3;
// Texels of a piece of work.
constexpr std::int64_t kGrain = 8;

// Mirrored light, light thrown back, and a wide lobe about the normal.
const std::array<LobeShape, 3> kStarts{LobeShape{{-1.0F, -1.0F, 1.0F}, 10.0F},
                                       LobeShape{{1.0F, 1.0F, 1.0F}, 5.0F},
                                       LobeShape{{0.0F, 0.0F, 1.0F}, 2.0F}};

}  // namespace

Status check_array(std::string_view what,
                   const MaterialFrame& frame,
                   std::int64_t layers,
                   Errc code,
                   std::string_view doing) {
  VENEER_TRY(check_texture(what, frame.width, frame.height, code, doing));
  if (layers <= kMostTextureLayers) return {};
  return fail(code,
              "{}: {} would take an array of {} textures, over {}; take fewer views or lobes",
              doing,
              what,
              layers,
              kMostTextureLayers);
}

Result<std::vector<Eigen::half>> read_colours(const SafetensorsFile& file,
                                              const std::string& name,
                                              const std::vector<std::int64_t>& shape) {
  VENEER_ASSIGN(std::vector<Eigen::half> values, read_halves(file, name, shape));
  const auto bad =
      std::ranges::find_if(values, [](Eigen::half h) { return h < Eigen::half(0.0F); });
  if (bad == values.end()) return values;
  return fail(Errc::kBadFormat,
              "reading {}: {}: element {} is negative",
              file.path().string(),
              name,
              bad - values.begin());
}

Result<std::vector<Eigen::half>> read_lobes(const SafetensorsFile& file,
                                            const std::vector<std::int64_t>& shape) {
  VENEER_ASSIGN(std::vector<Eigen::half> values, read_halves(file, "lobes", shape));
  for (std::size_t i = kLobeValues - 1; i < values.size(); i += kLobeValues) {
    const auto exponent = static_cast<float>(values[i]);
    if (exponent >= kLeastExponent && exponent <= kMostExponent) continue;
    return fail(Errc::kBadFormat,
                "reading {}: lobes: exponent {} is {}; it should be {} to {}",
                file.path().string(),
                i / kLobeValues,
                exponent,
                kLeastExponent,
                kMostExponent);
  }
  return values;
}

Eigen::Vector3d colour_at(std::span<const Eigen::half> values, std::size_t index) {
  return Eigen::Map<const Eigen::Matrix<Eigen::half, 3, 1>>(values.data() + kChannels * index)
      .cast<double>();
}

LayerWriter::LayerWriter(int texels, int layers)
    : texels_(static_cast<std::size_t>(texels)),
      layers_(layers),
      values_(4 * texels_ * static_cast<std::size_t>(layers)) {}

void LayerWriter::put(int layer, int texel, std::span<const Eigen::half> values) {
  const auto at = static_cast<std::size_t>(layer) * texels_ + static_cast<std::size_t>(texel);
  std::ranges::copy(values, values_.begin() + static_cast<std::ptrdiff_t>(4 * at));
}

ModelTexture LayerWriter::texture(std::string sampler, const MaterialFrame& frame) const {
  ModelTexture texture{.sampler = std::move(sampler),
                       .kind = TextureKind::k2DArray,
                       .format = TexelFormat::kRgba16f,
                       .width = frame.width,
                       .height = frame.height,
                       .depth = layers_};
  texture.data = texture_data(values_);
  return texture;
}

LobeSamples pair_samples(const MaterialFrame& frame) {
  LobeSamples samples{
      LobeSpace::kPair, Eigen::ArrayX3f(frame.pair_count(), 3), Eigen::ArrayXf(frame.pair_count())};
  Eigen::Index row = 0;
  for (const Direction& view : frame.views)
    for (const Direction& light : frame.lights) {
      samples.u.row(row) = view.cwiseProduct(light).transpose().cast<float>();
      samples.cosine[row++] = static_cast<float>(light.z());
    }
  return samples;
}

LobeSamples light_samples(const MaterialFrame& frame) {
  const auto lights = static_cast<Eigen::Index>(frame.lights.size());
  LobeSamples samples{LobeSpace::kLight, Eigen::ArrayX3f(lights, 3), Eigen::ArrayXf(lights)};
  for (Eigen::Index row = 0; row < lights; ++row) {
    const Direction& light = frame.lights[static_cast<std::size_t>(row)];
    samples.u.row(row) = light.transpose().cast<float>();
    samples.cosine[row] = static_cast<float>(light.z());
  }
  return samples;
}

LobeTargets weighted_targets(std::span<const float> rgb, std::span<const float> importance) {
  const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>> values(
      rgb.data(), static_cast<Eigen::Index>(rgb.size() / kChannels), 3);
  LobeTargets targets;
  targets.weight =
      (-kWeightPower * (values.rowwise().mean().array().max(0.0F) + kWeightFloor).log()).exp();
  if (!importance.empty())
    targets.weight *=
        Eigen::Map<const Eigen::ArrayXf>(importance.data(), targets.weight.size()).sqrt();
  targets.rgb = values.array().colwise() * targets.weight;
  return targets;
}

std::string fallback_remark(int texels) {
  return texels == 0 ? "" : fmt::format("{} texels stay diffuse", texels);
}

TexelFit fit_texel(const LobeFitter& fitter, const LobeTargets& targets) {
  const StoredLobes diffuse = fitter.store(targets, Diffuse::kFree, {});
  StoredLobes fitted = fitter.store(targets, Diffuse::kFree, fitter.fit(targets, kStarts));
  const bool better = fitted.squared_error < diffuse.squared_error;
  return {better ? std::move(fitted) : diffuse, !better};
}

LafortuneLobes::LafortuneLobes(int texels, int lobe_count)
    : lobes(lobe_count),
      diffuse(kChannels * static_cast<std::size_t>(texels)),
      specular(diffuse.size()),
      shapes(static_cast<std::size_t>(kLobeValues * lobe_count) *
             static_cast<std::size_t>(texels)) {}

void LafortuneLobes::set_texel(int texel, const StoredLobes& stored) {
  const auto at = static_cast<std::ptrdiff_t>(texel);
  std::ranges::copy(stored.diffuse, diffuse.begin() + 3 * at);
  std::ranges::copy(stored.specular, specular.begin() + 3 * at);
  std::ranges::copy(stored.lobes, shapes.begin() + kLobeValues * lobes * at);
}

LafortuneLobes LafortuneLobes::fit(const SampleSet& set,
                                   const FittedPairs& pairs,
                                   int lobes,
                                   Progress& progress) {
  const MaterialFrame& frame = pairs.frame();
  const LobeFitter fitter(pair_samples(frame), lobes);
  LafortuneLobes result(frame.texel_count(), lobes);
  std::atomic<int> fallbacks = 0;
  const std::vector<float> importance = pairs.weights_everywhere();
  progress.start("lobes", frame.texel_count());
  parallel_for(frame.texel_count(), kGrain, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(kChannels * static_cast<std::size_t>(frame.pair_count()));
    for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
      pairs.rgb(set, texel, Part::kTotal, rgb);
      const TexelFit fit = fit_texel(fitter, weighted_targets(rgb, importance));
      result.set_texel(texel, fit.stored);
      fallbacks += fit.fell_back ? 1 : 0;
    }
    progress.advance(end - begin);
  });
  result.fallback_texels = fallbacks;
  progress.finish(fallback_remark(fallbacks));
  return result;
}

Result<LafortuneLobes> LafortuneLobes::read(const SafetensorsFile& file,
                                            const MaterialFrame& frame) {
  const std::int64_t texels = frame.texel_count();
  VENEER_ASSIGN(const int lobes, read_integer(file, "lobes", 1, FitOptions::kMostLobes));
  LafortuneLobes result(0, lobes);
  VENEER_ASSIGN(result.fallback_texels,
                read_integer(file, "fallback_texels", 0, frame.texel_count()));
  VENEER_ASSIGN(result.diffuse, read_colours(file, "diffuse", {texels, 3}));
  VENEER_ASSIGN(result.specular, read_colours(file, "specular", {texels, 3}));
  VENEER_ASSIGN(result.shapes, read_lobes(file, {texels, result.lobes, kLobeValues}));
  return result;
}

void LafortuneLobes::add_to(int texels, Material::Contents& contents) const {
  contents.metadata["lobes"] = fmt::format("{}", lobes);
  contents.metadata["fallback_texels"] = fmt::format("{}", fallback_texels);
  contents.tensors.push_back(tensor_of("diffuse", {texels, 3}, diffuse));
  contents.tensors.push_back(tensor_of("specular", {texels, 3}, specular));
  contents.tensors.push_back(tensor_of("lobes", {texels, lobes, kLobeValues}, shapes));
}

Eigen::Vector3d LafortuneLobes::evaluate(int texel,
                                         const Direction& view,
                                         const Direction& light) const {
  const auto at = static_cast<std::size_t>(texel);
  const auto count = static_cast<std::size_t>(lobes);
  const Eigen::Vector3d u = view.cwiseProduct(light);
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i)
    sum += lobe_value(std::span(shapes).subspan(kLobeValues * (at * count + i), kLobeValues), u);
  return light.z() * (colour_at(diffuse, at) + sum * colour_at(specular, at));
}

Eigen::Vector3d LafortuneLobes::evaluate_diffuse(int texel, const Direction& light) const {
  return light.z() * colour_at(diffuse, static_cast<std::size_t>(texel));
}

ModelTexture LafortuneLobes::texture(const MaterialFrame& frame) const {
  LayerWriter writer(frame.texel_count(), layers());
  for (int texel = 0; texel < frame.texel_count(); ++texel) {
    const auto at = static_cast<std::size_t>(texel);
    writer.put(0, texel, std::span(diffuse).subspan(kChannels * at, kChannels));
    writer.put(1, texel, std::span(specular).subspan(kChannels * at, kChannels));
    for (int i = 0; i < lobes; ++i)
      writer.put(2 + i,
                 texel,
                 std::span(shapes).subspan(kLobeValues * (at * static_cast<std::size_t>(lobes) +
                                                          static_cast<std::size_t>(i)),
                                           kLobeValues));
  }
  return writer.texture("Lobes", frame);
}

}  // namespace veneer::btf
