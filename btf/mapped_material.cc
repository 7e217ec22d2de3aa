// SPDX-License-Identifier: Apache-2.0
#include "btf/mapped_material.h"

#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace veneer::btf {
namespace {

constexpr const char* kTensor = "texel_map";
constexpr const char* kSampler = "TexelMap";

class MappedMaterial final : public Material {
 public:
  MappedMaterial(std::unique_ptr<Material> sample, TexelMap map)
      : sample_(std::move(sample)), map_(std::move(map)) {}

  std::string_view model() const override { return sample_->model(); }
  int width() const override { return map_.width(); }
  int height() const override { return map_.height(); }
  const DirectionSet& views() const override { return sample_->views(); }
  const DirectionSet& lights() const override { return sample_->lights(); }
  bool has_specular_term() const override { return sample_->has_specular_term(); }
  double values_per_texel() const override { return sample_->values_per_texel(); }
  const TexelMap* texel_map() const override { return &map_; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    sample_->reconstruct_on(map_, texel, rgb);
  }
  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    return sample_->radiance_on(map_, texel, view, light);
  }
  Eigen::Vector3d diffuse_radiance(int texel,
                                   const Direction& view,
                                   const Direction& light) const override {
    if (!has_specular_term()) return radiance(texel, view, light);
    return sample_->diffuse_radiance(map_.source_texel(texel), view, light);
  }

  ModelShader shader() const override {
    ModelShader shader = sample_->shader();
    shader.source = fmt::format(
                        "#define TEXEL_MAP\n"
                        "const ivec2 kPlaces = ivec2({}, {});\n"
                        "uniform usampler2D {};\n",
                        map_.width(),
                        map_.height(),
                        kSampler) +
                    shader.source;
    shader.textures.push_back({.sampler = kSampler,
                               .format = TexelFormat::kRg16ui,
                               .width = map_.width(),
                               .height = map_.height(),
                               .data = texture_data(map_.sources())});
    shader.fetches += shader.texels_read;
    if (shader.cache) shader.cache->texel_fetches += 1;
    return shader;
  }

  Contents contents() const override {
    Contents contents = sample_->contents();
    contents.tensors.push_back({{kTensor, DType::kU16, {map_.height(), map_.width(), 2}},
                                std::as_bytes(std::span(map_.sources()))});
    return contents;
  }

 private:
  std::unique_ptr<Material> sample_;
  TexelMap map_;
};

}  // namespace

Result<std::unique_ptr<Material>> with_texel_map(std::unique_ptr<Material> material, TexelMap map) {
  constexpr std::string_view kDoing = "laying a material out over a larger tile";
  VENEER_TRY(refuse_texel_map(*material, Errc::kInvalidOption, kDoing));
  if (material->mip_levels() > 1)
    return fail(Errc::kInvalidOption,
                "{}: it has {} mip levels, whose texels are means of neighbours in the sample; fit "
                "it with --mip-levels 1",
                kDoing,
                material->mip_levels());
  if (material->width() != map.sample_width() || material->height() != map.sample_height())
    return fail(Errc::kInvalidOption,
                "{}: it has {} x {} texels, the map is for {} x {}",
                kDoing,
                material->width(),
                material->height(),
                map.sample_width(),
                map.sample_height());
  return std::make_unique<MappedMaterial>(std::move(material), std::move(map));
}

Result<std::optional<TexelMap>> read_texel_map(const SafetensorsFile& file,
                                               const Material& material) {
  if (!file.contains(kTensor)) return std::nullopt;
  VENEER_ASSIGN(const TensorView tensor, file.tensor(kTensor, DType::kU16, {-1, -1, 2}));
  const auto refused = [&](const std::string& why) {
    return fail(Errc::kBadFormat, "reading {}: {}: {}", file.path().string(), kTensor, why);
  };
  // Before the sides are cut to int.
  for (const std::int64_t side : {tensor.shape[0], tensor.shape[1]})
    if (side > TexelMap::kMostSide)
      return refused(fmt::format("{} places a side, over {}", side, TexelMap::kMostSide));
  std::vector<TexelMap::Source> sources(tensor.bytes.size() / sizeof(TexelMap::Source));
  if (!sources.empty()) std::memcpy(sources.data(), tensor.bytes.data(), tensor.bytes.size());
  auto map = TexelMap::create(static_cast<int>(tensor.shape[1]),
                              static_cast<int>(tensor.shape[0]),
                              std::move(sources),
                              material.width(),
                              material.height());
  if (!map) return refused(map.error().what);
  return std::move(*map);
}

Status refuse_texel_map(const Material& material, Errc code, std::string_view doing) {
  const TexelMap* map = material.texel_map();
  if (map == nullptr) return {};
  return fail(code,
              "{}: the material lays its sample of {} x {} texels out over {} x {} by a texel map "
              "(veneer expand); take the material that was expanded",
              doing,
              map->sample_width(),
              map->sample_height(),
              map->width(),
              map->height());
}

}  // namespace veneer::btf
