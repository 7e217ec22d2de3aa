// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/layered.h"

#include "btf/models/components.h"
#include "btf/models/layered/layer_fit.h"
#include "btf/models/lobes/lafortune_lobes.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "layered";

constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kLobesGlsl[] =
#include "btf/models/lobes/lobes.glsl.inc"
    ;
constexpr char kGlsl[] =
#include "btf/models/layered/layered.glsl.inc"
    ;

class Layered final : public Material {
 public:
  Layered(MaterialFrame frame, LayerFit fit) : frame_(std::move(frame)), fit_(std::move(fit)) {}

  std::string_view model() const override { return kName; }
  int width() const override { return frame_.width; }
  int height() const override { return frame_.height; }
  const DirectionSet& views() const override { return frame_.views; }
  const DirectionSet& lights() const override { return frame_.lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    reconstruct_at(texel, nullptr, rgb);
  }
  void reconstruct_on(const TexelMap& map, int place, std::span<float> rgb) const override {
    reconstruct_at(place, &map, rgb);
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    return fit_.stack.radiance(texel, view, light);
  }

  Eigen::Vector3d radiance_on(const TexelMap& map,
                              int place,
                              const Direction& view,
                              const Direction& light) const override {
    return fit_.stack.radiance(place, view, light, &map);
  }

  ModelShader shader() const override {
    ModelShader shader;
    const LayerStack& stack = fit_.stack;
    std::string heights;
    for (const float height : stack.heights())
      heights += fmt::format("{}{:.9e}", heights.empty() ? "" : ", ", height);
    shader.source = fmt::format(
        "const ivec2 kTexels = ivec2({}, {});\n"
        "const int kLayers = {};\n"
        "const float kHeights[kLayers] = float[]({});\n"
        "const float kLeastCosine = {};\n",
        frame_.width,
        frame_.height,
        stack.layer_count(),
        heights,
        LayerStack::kLeastCosine);
    for (const char* part : {kTexelAtGlsl, kLobesGlsl, kGlsl}) shader.source += part;
    shader.textures.push_back(stack.texture());
    // Four of each layer, and the transmittance of those above it towards the light.
    const int layers = stack.layer_count();
    shader.texels_read = layers + layers * (layers - 1) / 2;
    shader.fetches = 3 * layers + shader.texels_read;
    shader.shells = ShellLayers{{stack.heights().begin(), stack.heights().end()}};
    return shader;
  }

  double values_per_texel() const override { return kLayerValues * fit_.stack.layer_count(); }

  Contents contents() const override {
    Contents contents;
    add_frame(frame_, contents);
    fit_.stack.add_to(contents);
    contents.metadata["fallback_points"] = fmt::format("{}", fit_.fallback_points);
    return contents;
  }

 private:
  void reconstruct_at(int place, const TexelMap* map, std::span<float> rgb) const {
    auto out = rgb.begin();
    for (const Direction& view : frame_.views)
      for (const Direction& light : frame_.lights)
        for (const double value : fit_.stack.radiance(place, view, light, map))
          *out++ = static_cast<float>(value);
  }

  MaterialFrame frame_;
  LayerFit fit_;
};

}  // namespace

Result<std::unique_ptr<Material>> fit_layered(const SampleSet& set,
                                              const FitOptions& options,
                                              Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_form(options, kName));
  VENEER_TRY(refuse_precision(options, kName));
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  VENEER_TRY(check_array("the layers", pairs.frame(), 1, Errc::kInvalidOption, "fit"));
  VENEER_TRY(set.check_finite());
  return std::make_unique<Layered>(pairs.frame(), fit_layers(set, pairs, options, progress));
}

Result<std::unique_ptr<Material>> load_layered(const SafetensorsFile& file) {
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  VENEER_ASSIGN(LayerStack stack, LayerStack::read(file, frame));
  VENEER_ASSIGN(
      const int fallbacks,
      read_integer(file, "fallback_points", 0, LayerStack::kMostLayers * frame.texel_count()));
  return std::make_unique<Layered>(std::move(frame), LayerFit{std::move(stack), fallbacks});
}

std::unique_ptr<Material> layered_material(MaterialFrame frame, LayerStack stack) {
  VENEER_CHECK(frame.width == stack.width() && frame.height == stack.height());
  return std::make_unique<Layered>(std::move(frame), LayerFit{std::move(stack)});
}

}  // namespace veneer::btf
