// SPDX-License-Identifier: Apache-2.0
#include "btf/models/packed_lpca.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "btf/models/components.h"
#include "btf/models/packed_texels.h"

namespace veneer::btf {
namespace {

constexpr int kScalarsPerVolume = PackedLpca::kScalarsPerVolume;
constexpr const char* kMipLevels = "mip_levels";

constexpr char kElevatedConcentricGlsl[] =
#include "btf/models/elevated_concentric.glsl.inc"
    ;
constexpr char kClusterVolumeGlsl[] =
#include "btf/models/cluster_volume.glsl.inc"
    ;
constexpr char kHalfAngleGlsl[] =
#include "btf/models/half_angle.glsl.inc"
    ;

int volumes_for(int components) { return (components + kScalarsPerVolume - 1) / kScalarsPerVolume; }

int all_components(const PackedLpca::Layout& layout) {
  return layout.components[0] + layout.components[1];
}

// The lane of a texel's first colour, behind the weights.
int colour_lane_of(const PackedLpca::Layout& layout) {
  return volumes_for(all_components(layout)) * kScalarsPerVolume;
}

// The lane of a texel's cluster: the last, behind weights and colours.
int cluster_lane_of(const PackedLpca::Layout& layout) {
  return colour_lane_of(layout) + 3 * layout.colours;
}
PackedTexels texels_of(const PackedLpca::Layout& layout) {
  return PackedTexels(cluster_lane_of(layout) + 1);
}

GridShape view_shape(const MaterialFrame& frame, const PackedLpca::Layout& layout) {
  return GridShape::of(frame.views, DirectionRole::kView, layout.boxes.views, layout.angular);
}
GridShape light_shape(const MaterialFrame& frame, const PackedLpca::Layout& layout) {
  return GridShape::of(frame.lights, layout.beyond, layout.boxes.lights, layout.angular);
}

// As the constructor will lay them out, without the padding of clusters to whole rows.
double volume_bytes(const MaterialFrame& frame, const PackedLpca::Layout& layout, int clusters) {
  const double nodes =
      double(view_shape(frame, layout).count()) * light_shape(frame, layout).count();
  const auto [first, second] = layout.components;
  double values = nodes * volumes_for(layout.separate ? first : first + second);
  if (layout.half_angle)
    values = nodes * volumes_for(first) + half_angle::kNodes * volumes_for(second);
  else if (layout.separate)
    values += nodes * volumes_for(second);
  return values * clusters * static_cast<double>(bytes_per_texel(TexelFormat::kRgba16f));
}

}  // namespace

Status PackedLpca::check(const MaterialFrame& frame,
                         const Layout& layout,
                         int clusters,
                         Errc code,
                         std::string_view doing) {
  const int most_levels = TexelPyramid::most_levels(frame.width, frame.height);
  if (layout.mip_levels > most_levels)
    return fail(code,
                "{}: mip_levels is {}; {} x {} texels have at most {}",
                doing,
                layout.mip_levels,
                frame.width,
                frame.height,
                most_levels);
  const TexelPyramid pyramid = pyramid_of(frame, layout);
  VENEER_TRY(texels_of(layout).check(pyramid, code, doing));
  return ClusterVolume::check(
      volume_bytes(frame, layout, std::min(clusters, pyramid.texel_count())), code, doing);
}

TexelPyramid PackedLpca::pyramid_of(const MaterialFrame& frame, const Layout& layout) {
  return {frame.width, frame.height, layout.mip_levels};
}

Result<PackedLpca> PackedLpca::fit(const FittedPairs& pairs,
                                   const FitOptions& options,
                                   const Layout& layout,
                                   const Read& read,
                                   Progress& progress) {
  const MaterialFrame& frame = pairs.frame();
  VENEER_TRY(check(frame, layout, options.clusters, Errc::kInvalidOption, "fit"));
  const auto count = static_cast<std::size_t>(frame.pair_count());
  const auto source_of = [&](int parts, std::function<void(int, std::span<float>)> rows) {
    return RowSource{pyramid_of(frame, layout).texel_count(),
                     std::vector<int>(static_cast<std::size_t>(parts), frame.pair_count()),
                     std::move(rows)};
  };
  const auto [first, second] = layout.components;
  if (!layout.separate && second > 0) {
    const RowSource both = source_of(2, [&](int texel, std::span<float> values) {
      read(texel, values.first(count), values.last(count));
    });
    return PackedLpca(
        frame, layout, fit_factors(both, {first, second}, pairs.weights(), options, progress), {});
  }
  const RowSource firsts = source_of(1, [&](int texel, std::span<float> values) {
    std::vector<float> other(count);
    read(texel, values, other);
  });
  // Without the second function nothing of it decides which texels are alike.
  if (second == 0)
    return PackedLpca(
        frame, layout, fit_factors(firsts, {first}, pairs.weights(), options, progress), {});
  const RowSource seconds = source_of(1, [&](int texel, std::span<float> values) {
    std::vector<float> other(count);
    read(texel, other, values);
  });
  const LpcaFactors a = fit_factors(firsts, {first}, pairs.weights(), options, progress);
  LpcaFactors b = fit_factors(seconds, {second}, pairs.weights(), options, progress);
  return PackedLpca(frame, layout, side_by_side(a, b), std::move(b.cluster));
}

PackedLpca::PackedLpca(MaterialFrame frame,
                       Layout layout,
                       LpcaFactors factors,
                       std::vector<std::uint8_t> second_cluster)
    : frame_(std::move(frame)),
      layout_(layout),
      factors_(std::move(factors)),
      second_cluster_(std::move(second_cluster)),
      views_(frame_.views, DirectionRole::kView, view_shape(frame_, layout)),
      lights_(frame_.lights, layout.beyond, light_shape(frame_, layout)),
      place_(factors_.clusters, views_.shape(), lights_.shape(), 1),
      half_place_(factors_.clusters) {
  fill_volumes();
}

std::array<int, 2> PackedLpca::clusters_of(int texel) const {
  const auto at = static_cast<std::size_t>(texel);
  return {factors_.cluster[at], layout_.separate ? second_cluster_[at] : factors_.cluster[at]};
}

int PackedLpca::first_volumes() const {
  return volumes_for(is_split() ? layout_.components[0] : all_components(layout_));
}

int PackedLpca::volume_count() const {
  return first_volumes() + (is_split() ? volumes_for(layout_.components[1]) : 0);
}

PackedLpca::Slot PackedLpca::slot(int component) const {
  const bool behind = is_split() && component >= layout_.components[0];
  const int first = behind ? first_volumes() : 0;
  const int at = component - (behind ? layout_.components[0] : 0);
  return {static_cast<std::size_t>(first + at / kScalarsPerVolume),
          static_cast<std::size_t>(at % kScalarsPerVolume)};
}

Eigen::Vector2d PackedLpca::rmse(const Read& read, const FittedPairs& pairs) const {
  constexpr int kTexels = 64;
  const int texels = std::min(frame_.texel_count(), kTexels);
  const Eigen::ArrayXd importance = pairs.all_weights().cast<double>();
  std::vector<Eigen::Array2d> squares(static_cast<std::size_t>(texels), Eigen::Array2d::Zero());
  parallel_for(texels, 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> first(static_cast<std::size_t>(frame_.pair_count()));
    std::vector<float> second(first.size());
    for (std::int64_t i = begin; i < end; ++i) {
      const auto texel = static_cast<int>(i * frame_.texel_count() / texels);
      read(texel, first, second);
      Eigen::Index pair = 0;
      for (const Direction& view : frame_.views)
        for (const Direction& light : frame_.lights) {
          const Eigen::Array2d wanted(static_cast<double>(first[static_cast<std::size_t>(pair)]),
                                      static_cast<double>(second[static_cast<std::size_t>(pair)]));
          squares[static_cast<std::size_t>(i)] +=
              importance[pair] * (evaluate(texel, view, light).array() - wanted).square();
          ++pair;
        }
    }
  });
  Eigen::Array2d sum = Eigen::Array2d::Zero();
  for (const Eigen::Array2d& square : squares) sum += square;
  return (sum / (texels * importance.sum())).sqrt();
}

void PackedLpca::fill_volumes() {
  const int products = layout_.half_angle ? layout_.components[0] : factors_.components;
  volumes_.assign(static_cast<std::size_t>(layout_.half_angle ? first_volumes() : volume_count()),
                  std::vector<Eigen::half>(place_.texel_count() * kScalarsPerVolume));
  parallel_for(factors_.clusters, 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = static_cast<int>(begin); k < end; ++k) {
      for (int j = 0; j < products; ++j) {
        const RowMatrix measured =
            Eigen::Map<
                const Eigen::Matrix<Eigen::half, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
                factors_.eigen_brdf(k, j).data(),
                static_cast<Eigen::Index>(frame_.views.size()),
                static_cast<Eigen::Index>(frame_.lights.size()))
                .cast<float>();
        const RowMatrix nodes = lights_.fill() * (views_.fill() * measured).transpose();
        const Slot at = slot(j);
        for (Eigen::Index l = 0; l < nodes.rows(); ++l)
          for (Eigen::Index v = 0; v < nodes.cols(); ++v) {
            const std::size_t texel = place_.texel(k, 0, static_cast<int>(v), static_cast<int>(l));
            volumes_[at.volume][texel * kScalarsPerVolume + at.channel] =
                saturated_half(nodes(l, v));
          }
      }
    }
  });
  if (layout_.half_angle) fill_half_angles();
}

Result<PackedLpca> PackedLpca::load(const SafetensorsFile& file,
                                    Layout layout,
                                    bool with_mip_levels) {
  VENEER_ASSIGN(MaterialFrame frame, read_frame(file));
  VENEER_ASSIGN(const std::string text, file.meta("components"));
  const auto components = parse_two_terms(text, "a model of two terms");
  if (!components)
    return fail(Errc::kBadFormat, "reading {}: {}", file.path().string(), components.error().what);
  layout.components = *components;
  VENEER_ASSIGN(layout.angular,
                read_integer(file, "angular", FitOptions::kLeastAngular, FitOptions::kMostAngular));
  VENEER_ASSIGN(layout.boxes, read_boxes(file));
  layout.mip_levels = 1;
  if (file.metadata().contains(kMipLevels)) {
    const int most = with_mip_levels ? TexelPyramid::most_levels(frame.width, frame.height) : 1;
    VENEER_ASSIGN(layout.mip_levels, read_integer(file, kMipLevels, 1, most));
  }
  const int texels = pyramid_of(frame, layout).texel_count();
  VENEER_ASSIGN(
      LpcaFactors factors,
      read_factors(file, texels, layout.components[0] + layout.components[1], frame.pair_count()));
  std::vector<std::uint8_t> second_cluster;
  if (layout.separate) {
    VENEER_ASSIGN(second_cluster, read_clusters(file, "second_clusters", texels, factors.clusters));
  }
  VENEER_TRY(check(frame,
                   layout,
                   factors.clusters,
                   Errc::kBadFormat,
                   fmt::format("reading {}", file.path().string())));
  return PackedLpca(std::move(frame), layout, std::move(factors), std::move(second_cluster));
}

void PackedLpca::add_to(Material::Contents& contents) const {
  add_frame(frame_, contents);
  contents.metadata["components"] = format_components(layout_.components);
  contents.metadata["angular"] = fmt::format("{}", layout_.angular);
  // One level is what files without this entry have.
  if (layout_.mip_levels > 1) contents.metadata[kMipLevels] = fmt::format("{}", layout_.mip_levels);
  add_boxes(layout_.boxes, contents);
  const int texels = pyramid().texel_count();
  add_factors(factors_, texels, contents);
  if (layout_.separate)
    contents.tensors.push_back(tensor_of("second_clusters", {texels}, second_cluster_));
}

double PackedLpca::values_per_texel() const {
  const int texels = pyramid().texel_count();
  const int other = (layout_.separate ? 1 : 0) + 3 * layout_.colours;
  return (factors_.values_per_texel(texels) + other) * (double(texels) / frame_.texel_count());
}

void PackedLpca::reconstruct(int texel, std::span<float> first, std::span<float> second) const {
  const std::array<int, 2> clusters = clusters_of(texel);
  factors_.reconstruct(texel, clusters[0], 0, layout_.components[0], first);
  factors_.reconstruct(texel, clusters[1], layout_.components[0], layout_.components[1], second);
}

Eigen::Vector2d PackedLpca::evaluate(int texel,
                                     const Direction& view,
                                     const Direction& light) const {
  const GridWeights v = views_.weights(view);
  const GridWeights l = lights_.weights(light);
  const std::array<int, 2> k = clusters_of(texel);
  const std::span<const Eigen::half> weight = factors_.weights_of(texel);
  Eigen::Vector2d scalars = Eigen::Vector2d::Zero();
  const auto add = [&](int component, std::size_t at, double share) {
    const Slot from = slot(component);
    scalars[component < layout_.components[0] ? 0 : 1] +=
        share * static_cast<double>(weight[static_cast<std::size_t>(component)]) *
        static_cast<double>(volumes_[from.volume][at * kScalarsPerVolume + from.channel]);
  };
  const auto add_products = [&](int in_cluster, int first, int end) {
    for (std::size_t i = 0; i < 4; ++i) {
      if (l.weight[i] == 0.0) continue;
      for (std::size_t n = 0; n < 4; ++n) {
        const std::size_t at = place_.texel(in_cluster, 0, v.node[n], l.node[i]);
        for (int j = first; j < end; ++j) add(j, at, l.weight[i] * v.weight[n]);
      }
    }
  };
  add_products(k[0], 0, layout_.components[0]);
  if (!layout_.half_angle) {
    add_products(k[1], layout_.components[0], factors_.components);
    return scalars;
  }
  const half_angle::NodeWeights half = half_angle::weights(view, light);
  for (std::size_t i = 0; i < half.node.size(); ++i) {
    const std::size_t at = half_place_.texel(k[1], half.node[i]);
    for (int j = layout_.components[0]; j < factors_.components; ++j)
      add(j, at, std::max(light.z(), 0.0) * half.weight[i]);
  }
  return scalars;
}

ModelTexture PackedLpca::pack_texels(std::span<const Eigen::half> colours) const {
  const auto count = static_cast<std::size_t>(3 * layout_.colours);
  const int cluster_lane = cluster_lane_of(layout_);
  const auto bits = [](Eigen::half h) { return Eigen::numext::bit_cast<std::uint16_t>(h); };
  return texels_of(layout_).texture(pyramid(), [&](int texel, std::span<std::uint16_t> lanes) {
    const auto lane = static_cast<std::size_t>(cluster_lane);
    std::ranges::transform(factors_.weights_of(texel), lanes.begin(), bits);
    std::ranges::transform(colours.subspan(static_cast<std::size_t>(texel) * count, count),
                           lanes.subspan(lane - count).begin(),
                           bits);
    const std::array<int, 2> clusters = clusters_of(texel);
    // Two clusters in a lane where each function has its own.
    lanes[lane] =
        static_cast<std::uint16_t>(clusters[0] | (layout_.separate ? clusters[1] << 8 : 0));
  });
}

ModelTexture PackedLpca::volume_texture(int volume) const {
  const bool half_angle = layout_.half_angle && volume >= first_volumes();
  ModelTexture texture{.sampler = fmt::format("Volume{}", volume),
                       .kind = TextureKind::k3D,
                       .format = TexelFormat::kRgba16f,
                       .width = half_angle ? half_place_.width() : place_.width(),
                       .height = half_angle ? half_place_.height() : place_.height(),
                       .depth = half_angle ? half_place_.depth() : place_.depth(),
                       .linear = true};
  texture.data = texture_data(volumes_[static_cast<std::size_t>(volume)]);
  return texture;
}

ModelShader PackedLpca::shader(std::span<const Eigen::half> colours) const {
  const int first_colour = colour_lane_of(layout_);
  const int cluster_lane = cluster_lane_of(layout_);
  const PackedTexels texels = texels_of(layout_);
  const auto lane = [](int index) { return PackedTexels::half_lane(index); };

  std::string source =
      fmt::format("{}{}uniform usampler2D PackedTexels;\n", pyramid().glsl(), place_.constants());
  for (int v = 0; v < volume_count(); ++v)
    source += fmt::format("uniform sampler3D Volume{};\n", v);
  source += kElevatedConcentricGlsl;
  source += kClusterVolumeGlsl;
  if (layout_.half_angle) source += half_place_.constants() + kHalfAngleGlsl;

  // What a texel makes of the scalars, wherever these come from.
  std::string mix;
  for (int j = 0; j < factors_.components; ++j)
    mix += fmt::format("  scalars.{} += {} * eigen[{}].{};\n",
                       j < layout_.components[0] ? "x" : "y",
                       lane(j),
                       slot(j).volume,
                       "xyzw"[slot(j).channel]);
  for (int c = 0; c < layout_.colours; ++c)
    mix += fmt::format("  colours[{}] = vec3({}, {}, {});\n",
                       c,
                       lane(first_colour + 3 * c),
                       lane(first_colour + 3 * c + 1),
                       lane(first_colour + 3 * c + 2));
  std::string fetch = fmt::format("  ivec2 texel = texel_at(uv);\n{}  uint clusters = {};\n",
                                  texels.fetch(),
                                  PackedTexels::uint_lane(cluster_lane));
  fetch += layout_.separate ? "  uvec2 cluster = uvec2(clusters & 255u, clusters >> 8);\n"
                            : "  uvec2 cluster = uvec2(clusters);\n";
  fetch += fmt::format("  scalars = vec2(0.0);\n  vec4 eigen[{}];\n", volume_count());
  // The volumes at a place, the second function's at its own cluster.
  const auto volumes = [&](std::string_view view, std::string_view light) {
    std::string code =
        fmt::format("  VolumePlace place = volume_place(cluster.x, {}, {});\n", view, light);
    for (int v = 0; v < first_volumes(); ++v)
      code += fmt::format("  eigen[{0}] = volume_fetch(Volume{0}, place, 0.0);\n", v);
    if (layout_.half_angle)
      code +=
          fmt::format("  vec3 half_place = half_angle_place(cluster.y, {}, {});\n", view, light);
    else if (layout_.separate)
      code += fmt::format("  place = volume_place(cluster.y, {}, {});\n", view, light);
    for (int v = first_volumes(); v < volume_count(); ++v)
      code +=
          layout_.half_angle
              ? fmt::format(
                    "  eigen[{0}] = {1}.z * textureLod(Volume{0}, half_place, 0.0);\n", v, light)
              : fmt::format("  eigen[{0}] = volume_fetch(Volume{0}, place, 0.0);\n", v);
    return code;
  };

  const std::string results =
      fmt::format("out vec2 scalars, out vec3 colours[{}]", layout_.colours);
  source += fmt::format("void packed_evaluate(vec2 uv, vec3 view, vec3 light, {}) {{\n{}{}{}}}\n",
                        results,
                        fetch,
                        volumes("view", "light"),
                        mix);
  source += fmt::format(
      "#ifdef CACHE_NODES\n"
      "struct EigenPlace {{ vec3 view; vec3 light; }};\n"
      "EigenPlace eigen_place(vec3 view, vec3 light) {{ return EigenPlace(view, light); }}\n"
      "void eigen_values(EigenPlace at, int in_cluster, out vec4 eigen[{0}]) {{\n"
      "  uvec2 cluster = uvec2(in_cluster);\n{1}"
      "  for (int v = 0; v < {0}; ++v) eigen[v] *= at.light.z > 0.0 ? 1.0 : 0.0;\n}}\n#endif\n",
      volume_count(),
      volumes("at.view", "at.light"));
  source += fmt::format(
      "#ifdef CACHE_PIXELS\n"
      "void packed_cached(vec2 uv, {}) {{\n{}"
      "  for (int v = 0; v < {}; ++v)\n"
      "    eigen[v] = cached_eigen(int(v < {} ? cluster.x : cluster.y), v);\n{}}}\n#endif\n",
      results,
      fetch,
      volume_count(),
      first_volumes(),
      mix);

  ModelShader shader;
  shader.source = std::move(source);
  shader.textures.push_back(pack_texels(colours));
  for (int v = 0; v < volume_count(); ++v) shader.textures.push_back(volume_texture(v));
  const int single = layout_.half_angle ? volume_count() - first_volumes() : 0;
  shader.fetches = texels.words() + place_.fetches() * (volume_count() - single) + single;
  shader.cache = EigenCache{
      .clusters = factors_.clusters, .layers = volume_count(), .texel_fetches = texels.words()};
  return shader;
}

}  // namespace veneer::btf
