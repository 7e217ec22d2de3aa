// SPDX-License-Identifier: Apache-2.0
#include "btf/models/lafortune/lafortune.h"

#include <algorithm>

#include "btf/models/components.h"
#include "btf/models/lobes/lafortune_lobes.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "lafortune";

constexpr char kSpecularWeightGlsl[] =
#include "btf/models/specular_weight.glsl.inc"
    ;
constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kLobesGlsl[] =
#include "btf/models/lobes/lobes.glsl.inc"
    ;
constexpr char kLafortuneLobesGlsl[] =
#include "btf/models/lobes/lafortune_lobes.glsl.inc"
    ;
constexpr char kGlsl[] =
#include "btf/models/lafortune/lafortune.glsl.inc"
    ;

class Lafortune final : public Material {
 public:
  Lafortune(MaterialFrame frame, LafortuneLobes lobes)
      : frame_(std::move(frame)), lobes_(std::move(lobes)) {}

  std::string_view model() const override { return kName; }
  int width() const override { return frame_.width; }
  int height() const override { return frame_.height; }
  const DirectionSet& views() const override { return frame_.views; }
  const DirectionSet& lights() const override { return frame_.lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    auto out = rgb.begin();
    for (const Direction& view : frame_.views)
      for (const Direction& light : frame_.lights)
        for (const double value : lobes_.evaluate(texel, view, light))
          *out++ = static_cast<float>(value);
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    return lobes_.evaluate(texel, {view.x(), view.y(), std::max(view.z(), 0.0)}, light);
  }

  bool has_specular_term() const override { return true; }

  Eigen::Vector3d diffuse_radiance(int texel,
                                   const Direction& /*view*/,
                                   const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    return lobes_.evaluate_diffuse(texel, light);
  }

  ModelShader shader() const override {
    ModelShader shader;
    shader.source = fmt::format("const ivec2 kTexels = ivec2({}, {});\nconst int kLobes = {};\n",
                                frame_.width,
                                frame_.height,
                                lobes_.lobes);
    for (const char* part :
         {kSpecularWeightGlsl, kTexelAtGlsl, kLobesGlsl, kLafortuneLobesGlsl, kGlsl})
      shader.source += part;
    shader.textures.push_back(lobes_.texture(frame_));
    shader.fetches = lobes_.layers();
    return shader;
  }

  double values_per_texel() const override { return lobes_.values_per_texel(); }

  Contents contents() const override {
    Contents contents;
    add_frame(frame_, contents);
    lobes_.add_to(frame_.texel_count(), contents);
    return contents;
  }

 private:
  MaterialFrame frame_;
  LafortuneLobes lobes_;
};

}  // namespace

Result<std::unique_ptr<Material>> fit_lafortune(const SampleSet& set,
                                                const FitOptions& options,
                                                Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_form(options, kName));
  VENEER_TRY(refuse_precision(options, kName));
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  const MaterialFrame& frame = pairs.frame();
  VENEER_TRY(check_array("the lobes", frame, 2 + options.lobes, Errc::kInvalidOption, "fit"));
  VENEER_TRY(set.check_finite());
  return std::make_unique<Lafortune>(frame,
                                     LafortuneLobes::fit(set, pairs, options.lobes, progress));
}

Result<std::unique_ptr<Material>> load_lafortune(const SafetensorsFile& file) {
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  VENEER_ASSIGN(LafortuneLobes lobes, LafortuneLobes::read(file, frame));
  return std::make_unique<Lafortune>(std::move(frame), std::move(lobes));
}

}  // namespace veneer::btf
