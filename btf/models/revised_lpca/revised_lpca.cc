// SPDX-License-Identifier: Apache-2.0
#include "btf/models/revised_lpca/revised_lpca.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "btf/models/angular_grid.h"
#include "btf/models/cluster_volume.h"
#include "btf/models/components.h"
#include "btf/models/eigen_rgb.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/lpca_factors.h"
#include "btf/models/packed_texels.h"

namespace veneer::btf {
namespace {

constexpr std::string_view kName = "revised-lpca";
constexpr int kChannels = 4;  // of a volume's texel; the last is not used

constexpr char kElevatedConcentricGlsl[] =
#include "btf/models/elevated_concentric.glsl.inc"
    ;
constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kClusterVolumeGlsl[] =
#include "btf/models/cluster_volume.glsl.inc"
    ;

// What fit and file say of a material beside its factors.
struct Layout {
  int components = 0;
  int angular = 0;
  DirectionBoxes boxes = {};
  Precision precision = Precision::k8Bit;

  [[nodiscard]] TexelFormat format() const {
    return precision == Precision::k8Bit ? TexelFormat::kRgba8Snorm : TexelFormat::kRgba16f;
  }
  // A texel's weights, then its cluster.
  [[nodiscard]] PackedTexels texels() const { return PackedTexels(components + 1); }

  [[nodiscard]] GridShape view_shape(const MaterialFrame& frame) const {
    return GridShape::of(frame.views, DirectionRole::kView, boxes.views, angular);
  }
  [[nodiscard]] GridShape light_shape(const MaterialFrame& frame) const {
    return GridShape::of(frame.lights, DirectionRole::kLight, boxes.lights, angular);
  }

  [[nodiscard]] Status check(const MaterialFrame& frame,
                             int clusters,
                             Errc code,
                             std::string_view doing) const {
    VENEER_TRY(texels().check(frame, code, doing));
    const double nodes = double(view_shape(frame).count()) * light_shape(frame).count();
    return ClusterVolume::check(nodes * components * std::min(clusters, frame.texel_count()) *
                                    double(bytes_per_texel(format())),
                                code,
                                doing);
  }
};

// A signed normalised byte, as GL reads it, of a value in [-1, 1].
std::int8_t signed_byte(float value) {
  return static_cast<std::int8_t>(std::lround(127.0F * value));
}

class RevisedLpca final : public Material {
 public:
  RevisedLpca(MaterialFrame frame, Layout layout, LpcaFactors factors)
      : frame_(std::move(frame)),
        layout_(layout),
        factors_(std::move(factors)),
        views_(frame_.views, DirectionRole::kView, layout.view_shape(frame_)),
        lights_(frame_.lights, DirectionRole::kLight, layout.light_shape(frame_)),
        place_(factors_.clusters, views_.shape(), lights_.shape(), layout.components) {
    fill_volume();
  }

  std::string_view model() const override { return kName; }
  int width() const override { return frame_.width; }
  int height() const override { return frame_.height; }
  const DirectionSet& views() const override { return frame_.views; }
  const DirectionSet& lights() const override { return frame_.lights; }

  void reconstruct(int texel, std::span<float> rgb) const override {
    if (layout_.precision == Precision::kFloat16)
      return factors_.reconstruct(texel, 0, factors_.components, rgb);
    std::ranges::fill(rgb, 0.0F);
    for (int j = 0; j < factors_.components; ++j) {
      const auto weight =
          static_cast<float>(factors_.weights_of(texel)[static_cast<std::size_t>(j)]) / 127.0F;
      const auto brdf = factors_.eigen_brdf(factors_.cluster[static_cast<std::size_t>(texel)], j);
      for (std::size_t i = 0; i < rgb.size(); ++i)
        rgb[i] += weight * signed_byte(static_cast<float>(brdf[i]));
    }
  }

  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    if (!(light.z() > 0.0)) return Eigen::Vector3d::Zero();
    const GridWeights v = views_.weights(view);
    const GridWeights l = lights_.weights(light);
    const int k = factors_.cluster[static_cast<std::size_t>(texel)];
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int j = 0; j < factors_.components; ++j) {
      Eigen::Vector3d brdf = Eigen::Vector3d::Zero();
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t n = 0; n < 4; ++n)
          brdf += l.weight[i] * v.weight[n] * node(place_.texel(k, j, v.node[n], l.node[i]));
      sum += static_cast<double>(weights_[weight_index(texel, j)]) * brdf;
    }
    return sum.cwiseMax(0.0);
  }

  ModelShader shader() const override;

  double values_per_texel() const override {
    return factors_.values_per_texel(frame_.texel_count());
  }

  Contents contents() const override {
    Contents contents;
    add_frame(frame_, contents);
    contents.metadata["components"] = fmt::format("{}", layout_.components);
    contents.metadata["angular"] = fmt::format("{}", layout_.angular);
    contents.metadata["precision"] = name_of(layout_.precision);
    add_boxes(layout_.boxes, contents);
    add_factors(factors_, frame_.texel_count(), contents);
    return contents;
  }

 private:
  std::size_t weight_index(int texel, int component) const {
    return static_cast<std::size_t>(texel) * static_cast<std::size_t>(factors_.components) +
           static_cast<std::size_t>(component);
  }
  Eigen::Vector3d node(std::size_t texel) const {
    if (layout_.precision == Precision::kFloat16)
      return Eigen::Map<const Eigen::Matrix<Eigen::half, 3, 1>>(&halves_[texel * kChannels])
          .cast<double>();
    return Eigen::Map<const Eigen::Matrix<std::int8_t, 3, 1>>(&bytes_[texel * kChannels])
               .cast<double>() /
           127.0;
  }
  // One Eigen-BRDF at the nodes: [light node][view node] for each channel.
  std::array<RowMatrix, 3> at_nodes(int cluster, int component) const;
  void fill_volume();
  [[nodiscard]] std::string cached_source() const;  // the functions of EigenCache

  MaterialFrame frame_;
  Layout layout_;
  LpcaFactors factors_;
  AngularGrid views_;
  AngularGrid lights_;
  ClusterVolume place_;
  std::vector<Eigen::half> weights_;  // as factors_'s, times the scales of the volume
  // The volume, one of them by precision.
  std::vector<std::int8_t> bytes_;
  std::vector<Eigen::half> halves_;
};

std::array<RowMatrix, 3> RevisedLpca::at_nodes(int cluster, int component) const {
  using Channel =
      Eigen::Map<const Eigen::Matrix<Eigen::half, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>,
                 0,
                 Eigen::Stride<Eigen::Dynamic, 3>>;
  const auto views = static_cast<Eigen::Index>(frame_.views.size());
  const auto lights = static_cast<Eigen::Index>(frame_.lights.size());
  const std::span<const Eigen::half> brdf = factors_.eigen_brdf(cluster, component);
  std::array<RowMatrix, 3> nodes;
  for (std::size_t c = 0; c < 3; ++c) {
    const RowMatrix measured =
        Channel(&brdf[c], views, lights, Eigen::Stride<Eigen::Dynamic, 3>(3 * lights, 3))
            .cast<float>();
    nodes[c] = lights_.fill() * (views_.fill() * measured).transpose();
  }
  return nodes;
}

void RevisedLpca::fill_volume() {
  const bool bytes = layout_.precision == Precision::k8Bit;
  if (bytes) {
    bytes_.resize(place_.texel_count() * kChannels);
  } else {
    halves_.resize(place_.texel_count() * kChannels);
  }
  RowMatrix scales = RowMatrix::Ones(factors_.clusters, factors_.components);
  const std::int64_t count = std::int64_t{factors_.clusters} * factors_.components;
  parallel_for(count, 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<int>(begin); i < end; ++i) {
      const int k = i / factors_.components;
      const int j = i % factors_.components;
      const std::array<RowMatrix, 3> nodes = at_nodes(k, j);
      if (bytes) {
        scales(k, j) = 0.0F;
        for (const RowMatrix& channel : nodes)
          scales(k, j) = std::max(scales(k, j), channel.cwiseAbs().maxCoeff());
      }
      const float shrink = scales(k, j) > 0.0F ? 1.0F / scales(k, j) : 0.0F;
      for (Eigen::Index l = 0; l < nodes[0].rows(); ++l)
        for (Eigen::Index v = 0; v < nodes[0].cols(); ++v) {
          const std::size_t texel =
              kChannels * place_.texel(k, j, static_cast<int>(v), static_cast<int>(l));
          for (std::size_t c = 0; c < 3; ++c) {
            const float value = shrink * nodes[c](l, v);
            if (bytes) {
              bytes_[texel + c] = signed_byte(value);
            } else {
              halves_[texel + c] = saturated_half(value);
            }
          }
        }
    }
  });
  weights_.resize(factors_.weights.size());
  for (int texel = 0; texel < frame_.texel_count(); ++texel)
    for (int j = 0; j < factors_.components; ++j)
      weights_[weight_index(texel, j)] =
          saturated_half(scales(factors_.cluster[static_cast<std::size_t>(texel)], j) *
                         static_cast<float>(factors_.weights[weight_index(texel, j)]));
}

std::string RevisedLpca::cached_source() const {
  const PackedTexels texels = layout_.texels();
  const int components = layout_.components;
  std::string nodes;
  std::string pixels;
  for (int j = 0; j < components; ++j) {
    nodes += fmt::format("  vec3 brdf{0} = lit * volume_fetch(EigenBrdfs, place, {0}.0).rgb;\n", j);
    pixels += fmt::format("  sum += {} * {};\n", PackedTexels::half_lane(j), eigen_rgb(j));
  }
  return fmt::format(
      "#ifdef CACHE_NODES\n"
      "struct EigenPlace {{ vec3 view; vec3 light; }};\n"
      "EigenPlace eigen_place(vec3 view, vec3 light) {{ return EigenPlace(view, light); }}\n"
      "void eigen_values(EigenPlace at, int cluster, out vec4 values[{}]) {{\n"
      "  VolumePlace place = volume_place(uint(cluster), at.view, at.light);\n"
      "  float lit = at.light.z > 0.0 ? 1.0 : 0.0;\n{}{}}}\n#endif\n"
      "#ifdef CACHE_PIXELS\n"
      "vec3 btf_radiance_cached(vec2 uv) {{\n"
      "  ivec2 texel = texel_at(uv);\n{}"
      "  int cluster = int({});\n{}"
      "  vec3 sum = vec3(0.0);\n{}"
      "  return max(sum, 0.0);\n}}\n#endif\n",
      eigen_rgb_layers(components),
      nodes,
      fill_eigen_rgb(components),
      texels.fetch(),
      PackedTexels::uint_lane(components),
      fetch_eigen_rgb(components),
      pixels);
}

ModelShader RevisedLpca::shader() const {
  const PackedTexels texels = layout_.texels();
  const int components = layout_.components;
  ModelShader shader;
  shader.source = fmt::format(
      "const ivec2 kTexels = ivec2({}, {});\n{}"
      "uniform usampler2D PackedTexels;\n"
      "uniform sampler3D EigenBrdfs;\n",
      frame_.width,
      frame_.height,
      place_.constants());
  shader.source += kElevatedConcentricGlsl;
  shader.source += kTexelAtGlsl;
  shader.source += kClusterVolumeGlsl;
  shader.source += fmt::format(
      "vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {{\n"
      "  ivec2 texel = texel_at(uv);\n{}"
      "  VolumePlace place = volume_place({}, view, light);\n"
      "  vec3 sum = vec3(0.0);\n",
      texels.fetch(),
      PackedTexels::uint_lane(components));
  for (int j = 0; j < components; ++j)
    shader.source += fmt::format("  sum += {} * volume_fetch(EigenBrdfs, place, {}.0).rgb;\n",
                                 PackedTexels::half_lane(j),
                                 j);
  shader.source += "  return light.z > 0.0 ? max(sum, 0.0) : vec3(0.0);\n}\n";
  shader.source += cached_source();

  shader.textures.push_back(
      texels.texture(frame_, [this](int texel, std::span<std::uint16_t> lanes) {
        for (int j = 0; j < factors_.components; ++j)
          lanes[static_cast<std::size_t>(j)] =
              Eigen::numext::bit_cast<std::uint16_t>(weights_[weight_index(texel, j)]);
        lanes[static_cast<std::size_t>(factors_.components)] =
            factors_.cluster[static_cast<std::size_t>(texel)];
      }));
  ModelTexture volume{.sampler = "EigenBrdfs",
                      .kind = TextureKind::k3D,
                      .format = layout_.format(),
                      .width = place_.width(),
                      .height = place_.height(),
                      .depth = place_.depth(),
                      .linear = true};
  volume.data =
      layout_.precision == Precision::k8Bit ? texture_data(bytes_) : texture_data(halves_);
  shader.textures.push_back(std::move(volume));
  shader.fetches = texels.words() + place_.fetches() * components;
  shader.cache = EigenCache{.clusters = factors_.clusters,
                            .layers = eigen_rgb_layers(components),
                            .texel_fetches = texels.words()};
  return shader;
}

}  // namespace

Result<std::unique_ptr<Material>> fit_revised_lpca(const SampleSet& set,
                                                   const FitOptions& options,
                                                   Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(refuse_mip_levels(options, kName));
  VENEER_TRY(refuse_form(options, kName));
  Layout layout;
  VENEER_ASSIGN(layout.components, parse_one_term(options.components, kName));
  VENEER_ASSIGN(layout.precision, parse_precision(options.precision, Precision::k8Bit, kName));
  layout.angular = options.angular;
  VENEER_ASSIGN(const FittedPairs pairs, FittedPairs::of(set.info(), options.region));
  layout.boxes = pairs.boxes();
  const MaterialFrame& frame = pairs.frame();
  VENEER_TRY(layout.check(frame, options.clusters, Errc::kInvalidOption, "fit"));
  VENEER_TRY(check_samples(set, options));
  RowSource source;
  source.rows = frame.texel_count();
  source.part_columns = {frame.pair_count() * 3};
  source.read = [&](int texel, std::span<float> rgb) { pairs.rgb(set, texel, Part::kTotal, rgb); };
  LpcaFactors factors =
      fit_factors(source, {layout.components}, pairs.column_weights(3), options, progress);
  return std::make_unique<RevisedLpca>(frame, layout, std::move(factors));
}

Result<std::unique_ptr<Material>> load_revised_lpca(const SafetensorsFile& file) {
  const std::string doing = fmt::format("reading {}", file.path().string());
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  Layout layout;
  VENEER_ASSIGN(layout.components, read_integer(file, "components", 1, kMostComponents));
  VENEER_ASSIGN(layout.angular,
                read_integer(file, "angular", FitOptions::kLeastAngular, FitOptions::kMostAngular));
  VENEER_ASSIGN(layout.precision, read_precision(file, kName));
  VENEER_ASSIGN(layout.boxes, read_boxes(file));
  VENEER_ASSIGN(LpcaFactors factors,
                read_factors(file, frame.texel_count(), layout.components, 3 * frame.pair_count()));
  VENEER_TRY(layout.check(frame, factors.clusters, Errc::kBadFormat, doing));
  return std::make_unique<RevisedLpca>(std::move(frame), layout, std::move(factors));
}

}  // namespace veneer::btf
