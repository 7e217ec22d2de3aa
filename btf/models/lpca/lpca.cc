// SPDX-License-Identifier: Apache-2.0
#include "btf/models/lpca/lpca.h"

#include <algorithm>

#include "btf/models/components.h"
#include "btf/models/direction_lookup.h"
#include "btf/models/eigen_rgb.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/lpca_factors.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "lpca";
constexpr int kWeightsPerTexel = 4;  // of an RGBA texture

constexpr char kElevatedConcentricGlsl[] =
#include "btf/models/elevated_concentric.glsl.inc"
    ;
constexpr char kDirectionLookupGlsl[] =
#include "btf/models/direction_lookup.glsl.inc"
    ;
constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kGlsl[] =
#include "btf/models/lpca/lpca.glsl.inc"
    ;

Status check_textures(const MaterialFrame& frame,
                      int components,
                      Errc code,
                      std::string_view doing) {
  VENEER_TRY(check_texture("the texels", frame.width, frame.height, code, doing));
  return check_texture("the Eigen-BRDFs",
                       static_cast<std::int64_t>(frame.lights.size()),
                       static_cast<std::int64_t>(frame.views.size()) * components,
                       code,
                       doing);
}

class Lpca final : public Material {
 public:
  Lpca(MaterialFrame frame, LpcaFactors factors)
      : frame_(std::move(frame)),
        factors_(std::move(factors)),
        views_(frame_.views, DirectionRole::kView),
        lights_(frame_.lights, DirectionRole::kLight) {}

  std::string_view model() const override { return kName; }
  int width() const override { return frame_.width; }
  int height() const override { return frame_.height; }
  const DirectionSet& views() const override { return frame_.views; }
  const DirectionSet& lights() const override { return frame_.lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    factors_.reconstruct(texel, 0, factors_.components, rgb);
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    const Direction above(view.x(), view.y(), std::max(view.z(), 0.0));
    const DirectionWeights v = views_.weights(above);
    const DirectionWeights l = lights_.weights(light);
    const std::span<const Eigen::half> weight = factors_.weights_of(texel);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int c = 0; c < factors_.components; ++c) {
      const auto brdf = factors_.eigen_brdf(factors_.cluster[static_cast<std::size_t>(texel)], c);
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) {
          const auto pair = static_cast<std::size_t>(v.index[i]) * frame_.lights.size() +
                            static_cast<std::size_t>(l.index[j]);
          sum += static_cast<double>(weight[static_cast<std::size_t>(c)]) * v.weight[i] *
                 l.weight[j] *
                 Eigen::Map<const Eigen::Matrix<Eigen::half, 3, 1>>(&brdf[3 * pair]).cast<double>();
        }
    }
    return (l.scale * sum).cwiseMax(0.0);
  }

  ModelShader shader() const override;

  double values_per_texel() const override {
    return factors_.values_per_texel(frame_.texel_count());
  }

  Contents contents() const override {
    Contents contents;
    add_frame(frame_, contents);
    contents.metadata["components"] = fmt::format("{}", factors_.components);
    add_factors(factors_, frame_.texel_count(), contents);
    return contents;
  }

 private:
  MaterialFrame frame_;
  LpcaFactors factors_;
  DirectionLookup views_;
  DirectionLookup lights_;
};

// The functions of EigenCache.
std::string cached_source(int components) {
  std::string nodes;
  std::string pixels;
  for (int c = 0; c < components; ++c) {
    nodes += fmt::format("  vec3 brdf{0} = brdf_at(place, cluster, {0});\n", c);
    if (c % kWeightsPerTexel == 0)
      pixels += fmt::format("  vec4 weight{0} = texelFetch(Weights, ivec3(texel, {0}), 0);\n",
                            c / kWeightsPerTexel);
    pixels += fmt::format(
        "  sum += weight{}[{}] * {};\n", c / kWeightsPerTexel, c % kWeightsPerTexel, eigen_rgb(c));
  }
  return fmt::format(
      "#ifdef CACHE_NODES\n"
      "void eigen_values(EigenPlace place, int cluster, out vec4 values[{}]) {{\n{}{}}}\n#endif\n"
      "#ifdef CACHE_PIXELS\n"
      "vec3 btf_radiance_cached(vec2 uv) {{\n"
      "  ivec2 texel = texel_at(uv);\n"
      "  int cluster = int(texelFetch(Clusters, texel, 0).r);\n{}"
      "  vec3 sum = vec3(0.0);\n{}"
      "  return max(sum, 0.0);\n}}\n#endif\n",
      eigen_rgb_layers(components),
      nodes,
      fill_eigen_rgb(components),
      fetch_eigen_rgb(components),
      pixels);
}

ModelShader Lpca::shader() const {
  const int components = factors_.components;
  const int layers = (components + kWeightsPerTexel - 1) / kWeightsPerTexel;
  ModelShader shader;
  shader.source = fmt::format(
      "const ivec2 kTexels = ivec2({}, {});\nconst int kComponents = {};\nconst int kViews = {};\n",
      frame_.width,
      frame_.height,
      components,
      frame_.views.size());
  shader.source += kElevatedConcentricGlsl;
  shader.source += kDirectionLookupGlsl;
  shader.source += kTexelAtGlsl;
  shader.source += kGlsl;
  shader.source += cached_source(components);

  ModelTexture clusters{.sampler = "Clusters",
                        .format = TexelFormat::kR8ui,
                        .width = frame_.width,
                        .height = frame_.height};
  clusters.data = texture_data(factors_.cluster);
  shader.textures.push_back(std::move(clusters));

  ModelTexture weights{.sampler = "Weights",
                       .kind = TextureKind::k2DArray,
                       .format = TexelFormat::kRgba16f,
                       .width = frame_.width,
                       .height = frame_.height,
                       .depth = layers};
  std::vector<Eigen::half> padded(static_cast<std::size_t>(frame_.texel_count()) *
                                  static_cast<std::size_t>(layers * kWeightsPerTexel));
  for (int texel = 0; texel < frame_.texel_count(); ++texel)
    for (int c = 0; c < components; ++c)
      padded[(static_cast<std::size_t>(c / kWeightsPerTexel) *
                  static_cast<std::size_t>(frame_.texel_count()) +
              static_cast<std::size_t>(texel)) *
                 kWeightsPerTexel +
             static_cast<std::size_t>(c % kWeightsPerTexel)] =
          factors_.weights_of(texel)[static_cast<std::size_t>(c)];
  weights.data = texture_data(padded);
  shader.textures.push_back(std::move(weights));

  // A layer for each cluster; in it a row for each (component, view), a column for each light.
  ModelTexture brdfs{.sampler = "EigenBrdfs",
                     .kind = TextureKind::k2DArray,
                     .format = TexelFormat::kRgba16f,
                     .width = static_cast<int>(frame_.lights.size()),
                     .height = components * static_cast<int>(frame_.views.size()),
                     .depth = factors_.clusters};
  std::vector<Eigen::half> rgba;
  rgba.reserve(factors_.eigen_brdfs.size() / 3 * 4);
  for (std::size_t i = 0; i < factors_.eigen_brdfs.size(); i += 3) {
    rgba.insert(rgba.end(),
                {factors_.eigen_brdfs[i],
                 factors_.eigen_brdfs[i + 1],
                 factors_.eigen_brdfs[i + 2],
                 Eigen::half(0.0F)});
  }
  brdfs.data = texture_data(rgba);
  shader.textures.push_back(std::move(brdfs));

  views_.add_textures("View", shader.textures);
  lights_.add_textures("Light", shader.textures);
  shader.fetches = 1 + layers + 2 * DirectionLookup::kFetches + 9 * components;
  shader.cache = EigenCache{.clusters = factors_.clusters,
                            .layers = eigen_rgb_layers(components),
                            .texel_fetches = 1 + layers};
  return shader;
}

}  // namespace

Result<std::unique_ptr<Material>> fit_lpca(const SampleSet& set,
                                           const FitOptions& options,
                                           Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_form(options, kName));
  VENEER_TRY(refuse_precision(options, kName));
  VENEER_ASSIGN(const int components, parse_one_term(options.components, kName));
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  const MaterialFrame& frame = pairs.frame();
  VENEER_TRY(check_textures(frame, components, Errc::kInvalidOption, "fit"));
  VENEER_TRY(check_samples(set, options));
  RowSource source;
  source.rows = frame.texel_count();
  source.part_columns = {frame.pair_count() * 3};
  source.read = [&](int texel, std::span<float> rgb) { pairs.rgb(set, texel, Part::kTotal, rgb); };
  LpcaFactors factors =
      fit_factors(source, {components}, pairs.column_weights(3), options, progress);
  return std::make_unique<Lpca>(frame, std::move(factors));
}

Result<std::unique_ptr<Material>> load_lpca(const SafetensorsFile& file) {
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  VENEER_ASSIGN(const int components, read_integer(file, "components", 1, kMostComponents));
  VENEER_TRY(check_textures(
      frame, components, Errc::kBadFormat, fmt::format("reading {}", file.path().string())));
  VENEER_ASSIGN(LpcaFactors factors,
                read_factors(file, frame.texel_count(), components, 3 * frame.pair_count()));
  return std::make_unique<Lpca>(std::move(frame), std::move(factors));
}

}  // namespace veneer::btf
