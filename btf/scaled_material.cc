// SPDX-License-Identifier: Apache-2.0
#include "btf/scaled_material.h"

#include <charconv>
#include <string>
#include <utility>

namespace veneer::btf {
namespace {

constexpr const char* kScale = "scale";
// The bounds of a set's scale, and room for the range of float16 beyond them.
constexpr double kLeast = 1e-33;
constexpr double kMost = 1e33;

class ScaledMaterial final : public Material {
 public:
  ScaledMaterial(std::unique_ptr<Material> stored, double scale)
      : stored_(std::move(stored)), scale_(scale) {}

  std::string_view model() const override { return stored_->model(); }
  int width() const override { return stored_->width(); }
  int height() const override { return stored_->height(); }
  const DirectionSet& views() const override { return stored_->views(); }
  const DirectionSet& lights() const override { return stored_->lights(); }
  int mip_levels() const override { return stored_->mip_levels(); }
  bool has_specular_term() const override { return stored_->has_specular_term(); }
  double values_per_texel() const override { return stored_->values_per_texel(); }

  void reconstruct(int texel, std::span<float> rgb) const override {
    stored_->reconstruct(texel, rgb);
    for (float& value : rgb) value *= static_cast<float>(scale_);
  }
  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    return scale_ * stored_->radiance(texel, view, light);
  }
  Eigen::Vector3d radiance_on(const TexelMap& map,
                              int place,
                              const Direction& view,
                              const Direction& light) const override {
    return scale_ * stored_->radiance_on(map, place, view, light);
  }
  void reconstruct_on(const TexelMap& map, int place, std::span<float> rgb) const override {
    stored_->reconstruct_on(map, place, rgb);
    for (float& value : rgb) value *= static_cast<float>(scale_);
  }
  Eigen::Vector3d diffuse_radiance(int texel,
                                   const Direction& view,
                                   const Direction& light) const override {
    return scale_ * stored_->diffuse_radiance(texel, view, light);
  }

  // The model's own functions under other names, and behind them the ones that everybody calls.
  ModelShader shader() const override {
    ModelShader shader = stored_->shader();
    shader.source = fmt::format(
        "const float kSampleScale = {:.9e};\n"
        "#define btf_radiance btf_radiance_stored\n"
        "#define btf_radiance_cached btf_radiance_cached_stored\n"
        "{}"
        "#undef btf_radiance\n"
        "#undef btf_radiance_cached\n"
        "vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {{\n"
        "  return kSampleScale * btf_radiance_stored(uv, view, light);\n"
        "}}\n",
        scale_,
        shader.source);
    if (shader.cache)
      shader.source +=
          "#ifdef CACHE_PIXELS\n"
          "vec3 btf_radiance_cached(vec2 uv) {\n"
          "  return kSampleScale * btf_radiance_cached_stored(uv);\n"
          "}\n"
          "#endif\n";
    return shader;
  }

  Contents contents() const override {
    Contents contents = stored_->contents();
    contents.metadata[kScale] = fmt::format("{}", scale_);
    return contents;
  }

 private:
  std::unique_ptr<Material> stored_;
  double scale_;
};

}  // namespace

std::unique_ptr<Material> with_scale(std::unique_ptr<Material> material, double scale) {
  VENEER_CHECK(scale >= kLeast && scale <= kMost);
  if (scale == 1.0) return material;
  return std::make_unique<ScaledMaterial>(std::move(material), scale);
}

Result<double> read_scale(const SafetensorsFile& file) {
  const auto entry = file.metadata().find(kScale);
  if (entry == file.metadata().end()) return 1.0;
  const std::string& text = entry->second;
  double scale = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), scale);
  if (error != std::errc{} || end != text.data() + text.size() ||
      !(scale >= kLeast && scale <= kMost))
    return fail(Errc::kBadFormat,
                "reading {}: {} is \"{}\"; it should be {} to {}",
                file.path().string(),
                kScale,
                text,
                kLeast,
                kMost);
  return scale;
}

}  // namespace veneer::btf
