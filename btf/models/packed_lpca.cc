// SPDX-License-Identifier: Apache-2.0
#include "btf/models/packed_lpca.h"

#include <algorithm>

#include "base/parallel.h"
#include "btf/models/components.h"
#include "btf/models/packed_texels.h"

namespace veneer::btf {
namespace {

constexpr int kScalarsPerVolume = 4;

constexpr char kElevatedConcentricGlsl[] =
#include "btf/models/elevated_concentric.glsl.inc"
    ;
constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kClusterVolumeGlsl[] =
#include "btf/models/cluster_volume.glsl.inc"
    ;

int volumes_for(const PackedLpca::Components& components) {
  return (components[0] + components[1] + kScalarsPerVolume - 1) / kScalarsPerVolume;
}

// The lane of a texel's cluster: the last, behind weights and colours.
int cluster_lane_of(const PackedLpca::Layout& layout) {
  return volumes_for(layout.components) * kScalarsPerVolume + 3 * layout.colours;
}
PackedTexels texels_of(const PackedLpca::Layout& layout) {
  return PackedTexels(cluster_lane_of(layout) + 1);
}

// As the constructor will lay them out, without the padding of clusters to whole rows.
double volume_bytes(const MaterialFrame& frame, const PackedLpca::Layout& layout, int clusters) {
  const double nodes = layout.angular * layout.angular;
  const double view_nodes = frame.views.size() == 1 ? 1.0 : nodes;
  return view_nodes * nodes * clusters * volumes_for(layout.components) *
         static_cast<double>(bytes_per_texel(TexelFormat::kRgba16f));
}

}  // namespace

Status PackedLpca::check(const MaterialFrame& frame,
                         const Layout& layout,
                         int clusters,
                         Errc code,
                         std::string_view doing) {
  VENEER_TRY(texels_of(layout).check(frame, code, doing));
  return ClusterVolume::check(
      volume_bytes(frame, layout, std::min(clusters, frame.texel_count())), code, doing);
}

Result<PackedLpca> PackedLpca::fit(const MaterialFrame& frame,
                                   const FitOptions& options,
                                   const Layout& layout,
                                   const Read& read,
                                   Progress& progress) {
  VENEER_TRY(check(frame, layout, options.clusters, Errc::kInvalidOption, "fit"));
  const int pairs = frame.pair_count();
  RowSource source;
  source.rows = frame.texel_count();
  source.part_columns = {pairs, pairs};
  source.read = [&read, pairs](int texel, std::span<float> values) {
    const auto count = static_cast<std::size_t>(pairs);
    read(texel, values.first(count), values.last(count));
  };
  const auto [first, second] = layout.components;
  return PackedLpca(frame, layout, fit_factors(source, {first, second}, options, progress));
}

PackedLpca::PackedLpca(MaterialFrame frame, Layout layout, LpcaFactors factors)
    : frame_(std::move(frame)),
      layout_(layout),
      factors_(std::move(factors)),
      views_(frame_.views, DirectionRole::kView, layout.angular),
      lights_(frame_.lights, layout.beyond, layout.angular),
      place_(factors_.clusters, views_.nodes(), lights_.nodes(), 1) {
  fill_volumes();
}

int PackedLpca::volume_count() const { return volumes_for(layout_.components); }

void PackedLpca::fill_volumes() {
  volumes_.assign(static_cast<std::size_t>(volume_count()),
                  std::vector<Eigen::half>(place_.texel_count() * kScalarsPerVolume));
  parallel_for(factors_.clusters, 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = static_cast<int>(begin); k < end; ++k) {
      for (int j = 0; j < factors_.components; ++j) {
        const RowMatrix measured =
            Eigen::Map<
                const Eigen::Matrix<Eigen::half, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
                factors_.eigen_brdf(k, j).data(),
                static_cast<Eigen::Index>(frame_.views.size()),
                static_cast<Eigen::Index>(frame_.lights.size()))
                .cast<float>();
        const RowMatrix nodes = lights_.fill() * (views_.fill() * measured).transpose();
        std::vector<Eigen::half>& volume =
            volumes_[static_cast<std::size_t>(j / kScalarsPerVolume)];
        for (Eigen::Index l = 0; l < nodes.rows(); ++l)
          for (Eigen::Index v = 0; v < nodes.cols(); ++v) {
            const std::size_t texel = place_.texel(k, 0, static_cast<int>(v), static_cast<int>(l));
            volume[texel * kScalarsPerVolume + static_cast<std::size_t>(j % kScalarsPerVolume)] =
                saturated_half(nodes(l, v));
          }
      }
    }
  });
}

Result<PackedLpca> PackedLpca::load(const SafetensorsFile& file,
                                    DirectionRole beyond,
                                    int colours) {
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  VENEER_ASSIGN(const std::string text, file.meta("components"));
  const auto components = parse_two_terms(text, "a model of two terms");
  if (!components)
    return fail(Errc::kBadFormat, "reading {}: {}", file.path().string(), components.error().what);
  Layout layout{*components, 0, beyond, colours};
  VENEER_ASSIGN(layout.angular,
                read_integer(file, "angular", FitOptions::kLeastAngular, FitOptions::kMostAngular));
  VENEER_ASSIGN(LpcaFactors factors,
                read_factors(file,
                             frame.texel_count(),
                             layout.components[0] + layout.components[1],
                             frame.pair_count()));
  VENEER_TRY(check(frame,
                   layout,
                   factors.clusters,
                   Errc::kBadFormat,
                   fmt::format("reading {}", file.path().string())));
  return PackedLpca(std::move(frame), layout, std::move(factors));
}

void PackedLpca::add_to(Material::Contents& contents) const {
  add_frame(frame_, contents);
  contents.metadata["components"] = format_components(layout_.components);
  contents.metadata["angular"] = fmt::format("{}", layout_.angular);
  add_factors(factors_, frame_.texel_count(), contents);
}

void PackedLpca::reconstruct(int texel, std::span<float> first, std::span<float> second) const {
  factors_.reconstruct(texel, 0, layout_.components[0], first);
  factors_.reconstruct(texel, layout_.components[0], layout_.components[1], second);
}

Eigen::Vector2d PackedLpca::evaluate(int texel,
                                     const Direction& view,
                                     const Direction& light) const {
  const GridWeights v = views_.weights(view);
  const GridWeights l = lights_.weights(light);
  const int k = factors_.cluster[static_cast<std::size_t>(texel)];
  const std::span<const Eigen::half> weight = factors_.weights_of(texel);
  Eigen::Vector2d scalars = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    if (l.weight[i] == 0.0) continue;
    for (std::size_t n = 0; n < 4; ++n) {
      const std::size_t at = place_.texel(k, 0, v.node[n], l.node[i]);
      for (int j = 0; j < factors_.components; ++j) {
        const std::vector<Eigen::half>& volume =
            volumes_[static_cast<std::size_t>(j / kScalarsPerVolume)];
        const auto value = static_cast<double>(
            volume[at * kScalarsPerVolume + static_cast<std::size_t>(j % kScalarsPerVolume)]);
        scalars[j < layout_.components[0] ? 0 : 1] +=
            l.weight[i] * v.weight[n] * static_cast<double>(weight[static_cast<std::size_t>(j)]) *
            value;
      }
    }
  }
  return scalars;
}

ModelTexture PackedLpca::pack_texels(std::span<const Eigen::half> colours) const {
  const auto count = static_cast<std::size_t>(3 * layout_.colours);
  const int cluster_lane = cluster_lane_of(layout_);
  const auto bits = [](Eigen::half h) { return Eigen::numext::bit_cast<std::uint16_t>(h); };
  return texels_of(layout_).texture(frame_, [&](int texel, std::span<std::uint16_t> lanes) {
    const auto lane = static_cast<std::size_t>(cluster_lane);
    std::ranges::transform(factors_.weights_of(texel), lanes.begin(), bits);
    std::ranges::transform(colours.subspan(static_cast<std::size_t>(texel) * count, count),
                           lanes.subspan(lane - count).begin(),
                           bits);
    lanes[lane] = factors_.cluster[static_cast<std::size_t>(texel)];
  });
}

ModelShader PackedLpca::shader(std::span<const Eigen::half> colours) const {
  const int first_colour = volume_count() * kScalarsPerVolume;
  const int cluster_lane = cluster_lane_of(layout_);
  const PackedTexels texels = texels_of(layout_);
  const auto lane = [](int index) { return PackedTexels::half_lane(index); };

  std::string source = fmt::format(
      "const ivec2 kTexels = ivec2({}, {});\n{}"
      "uniform usampler2D PackedTexels;\n",
      frame_.width,
      frame_.height,
      place_.constants());
  for (int v = 0; v < volume_count(); ++v)
    source += fmt::format("uniform sampler3D Volume{};\n", v);
  source += kElevatedConcentricGlsl;
  source += kTexelAtGlsl;
  source += kClusterVolumeGlsl;

  // What a texel makes of the scalars, wherever these come from.
  std::string mix;
  for (int v = 0; v < volume_count(); ++v)
    for (int c = 0; c < kScalarsPerVolume && v * kScalarsPerVolume + c < factors_.components; ++c) {
      const int j = v * kScalarsPerVolume + c;
      mix += fmt::format("  scalars.{} += {} * eigen[{}].{};\n",
                         j < layout_.components[0] ? "x" : "y",
                         lane(j),
                         v,
                         "xyzw"[c]);
    }
  for (int c = 0; c < layout_.colours; ++c)
    mix += fmt::format("  colours[{}] = vec3({}, {}, {});\n",
                       c,
                       lane(first_colour + 3 * c),
                       lane(first_colour + 3 * c + 1),
                       lane(first_colour + 3 * c + 2));
  std::string fetch = fmt::format("  ivec2 texel = texel_at(uv);\n{}  uint cluster = {};\n",
                                  texels.fetch(),
                                  PackedTexels::uint_lane(cluster_lane));
  fetch += fmt::format("  scalars = vec2(0.0);\n  vec4 eigen[{}];\n", volume_count());
  std::string volumes;
  for (int v = 0; v < volume_count(); ++v)
    volumes += fmt::format("  eigen[{0}] = volume_fetch(Volume{0}, place, 0.0);\n", v);

  const std::string results =
      fmt::format("out vec2 scalars, out vec3 colours[{}]", layout_.colours);
  source += fmt::format(
      "void packed_evaluate(vec2 uv, vec3 view, vec3 light, {}) {{\n{}"
      "  VolumePlace place = volume_place(cluster, view, light);\n{}{}}}\n",
      results,
      fetch,
      volumes,
      mix);
  source += fmt::format(
      "#ifdef CACHE_NODES\n"
      "struct EigenPlace {{ vec3 view; vec3 light; }};\n"
      "EigenPlace eigen_place(vec3 view, vec3 light) {{ return EigenPlace(view, light); }}\n"
      "void eigen_values(EigenPlace at, int cluster, out vec4 eigen[{0}]) {{\n"
      "  VolumePlace place = volume_place(uint(cluster), at.view, at.light);\n{1}"
      "  for (int v = 0; v < {0}; ++v) eigen[v] *= at.light.z > 0.0 ? 1.0 : 0.0;\n}}\n#endif\n",
      volume_count(),
      volumes);
  source += fmt::format(
      "#ifdef CACHE_PIXELS\n"
      "void packed_cached(vec2 uv, {}) {{\n{}"
      "  for (int v = 0; v < {}; ++v) eigen[v] = cached_eigen(int(cluster), v);\n{}}}\n#endif\n",
      results,
      fetch,
      volume_count(),
      mix);

  ModelShader shader;
  shader.source = std::move(source);
  shader.textures.push_back(pack_texels(colours));
  for (int v = 0; v < volume_count(); ++v) {
    ModelTexture volume{.sampler = fmt::format("Volume{}", v),
                        .kind = TextureKind::k3D,
                        .format = TexelFormat::kRgba16f,
                        .width = place_.width(),
                        .height = place_.height(),
                        .depth = place_.depth(),
                        .linear = true};
    volume.data = texture_data(volumes_[static_cast<std::size_t>(v)]);
    shader.textures.push_back(std::move(volume));
  }
  shader.fetches = texels.words() + 2 * volume_count();
  shader.cache = EigenCache{
      .clusters = factors_.clusters, .layers = volume_count(), .texel_fetches = texels.words()};
  return shader;
}

}  // namespace veneer::btf
