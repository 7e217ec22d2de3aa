// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/layer_stack.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "btf/models/lobes/lafortune_lobes.h"
#include "btf/models/lobes/lobe_fit.h"

namespace veneer::btf {
namespace {

constexpr int kTexturesPerLayer = 4;

// Where in a stored point things lie.
constexpr std::size_t kDiffuse = 0;
constexpr std::size_t kTransmittance = 3;
constexpr std::size_t kSpecular = 4;
constexpr std::size_t kExponent = 7;
constexpr std::size_t kLobe = 8;
constexpr std::size_t kDiffuseRadiance = 11;
constexpr std::size_t kNormal = 12;

int wrapped(int value, int size) {
  const int rest = value % size;
  return rest < 0 ? rest + size : rest;
}

// The texel that a place shows.
int shown(int place, const TexelMap* map) {
  return map != nullptr ? map->source_texel(place) : place;
}

// What is wrong with a stored point, or nothing.
std::string_view fault_of(std::span<const Eigen::half> values, bool is_top, bool is_lowest) {
  const auto value = [values](std::size_t i) { return static_cast<float>(values[i]); };
  for (const std::size_t first : {kDiffuse, kSpecular})
    for (std::size_t c = 0; c < 3; ++c)
      if (value(first + c) < 0.0F) return "has a negative colour";
  const float transmittance = value(kTransmittance);
  if (!(transmittance >= 0.0F && transmittance <= 1.0F))
    return "has a transmittance outside 0 to 1";
  if (is_lowest && transmittance != 0.0F) return "is of the lowest layer and not opaque";
  if (!(value(kExponent) >= kLeastExponent && value(kExponent) <= kMostExponent))
    return "has an exponent outside 1 to 200";
  if (value(kDiffuseRadiance) < 0.0F) return "has a negative diffuse radiance";
  if (is_top && value(kDiffuseRadiance) != 0.0F)
    return "is of the top layer and has a diffuse radiance";
  const float length = std::hypot(value(kNormal), value(kNormal + 1), value(kNormal + 2));
  if (std::abs(length - 1.0F) > 0.01F) return "has a normal that is not of unit length";
  return {};
}

}  // namespace

LayerStack::LayerStack(int width, int height, std::vector<float> heights)
    : width_(width),
      height_(height),
      heights_(std::move(heights)),
      values_(heights_.size() * static_cast<std::size_t>(texel_count()) * kLayerValues) {
  VENEER_CHECK(!heights_.empty() && heights_.size() <= kMostLayers);
  VENEER_CHECK(std::ranges::adjacent_find(heights_, std::less_equal{}) == heights_.end());
  for (int layer = 0; layer < layer_count(); ++layer)
    for (int texel = 0; texel < texel_count(); ++texel) set_point(layer, texel, {});
}

std::span<const Eigen::half, kLayerValues> LayerStack::stored(int layer, int texel) const {
  const std::size_t at = static_cast<std::size_t>(layer) * static_cast<std::size_t>(texel_count()) +
                         static_cast<std::size_t>(texel);
  return std::span<const Eigen::half, kLayerValues>(values_.data() + at * kLayerValues,
                                                    kLayerValues);
}

double LayerStack::transmittance(int layer, int texel) const {
  return static_cast<float>(stored(layer, texel)[kTransmittance]);
}

LayerPoint LayerStack::point(int layer, int texel) const {
  const auto values = stored(layer, texel);
  return {.diffuse = colour_at(values.subspan<kDiffuse>(), 0).cast<float>(),
          .transmittance = static_cast<float>(values[kTransmittance]),
          .specular = colour_at(values.subspan<kSpecular>(), 0).cast<float>(),
          .exponent = static_cast<float>(values[kExponent]),
          .lobe = colour_at(values.subspan<kLobe>(), 0).cast<float>(),
          .diffuse_radiance = static_cast<float>(values[kDiffuseRadiance]),
          .normal = colour_at(values.subspan<kNormal>(), 0).cast<float>()};
}

void LayerStack::set_point(int layer, int texel, const LayerPoint& point) {
  const bool is_lowest = layer == layer_count() - 1;
  const std::array<float, kLayerValues> values{point.diffuse[0],
                                               point.diffuse[1],
                                               point.diffuse[2],
                                               is_lowest ? 0.0F : point.transmittance,
                                               point.specular[0],
                                               point.specular[1],
                                               point.specular[2],
                                               point.exponent,
                                               point.lobe[0],
                                               point.lobe[1],
                                               point.lobe[2],
                                               layer == 0 ? 0.0F : point.diffuse_radiance,
                                               point.normal[0],
                                               point.normal[1],
                                               point.normal[2]};
  const auto at = stored(layer, texel).data() - values_.data();
  std::ranges::transform(values, values_.begin() + at, saturated_half);
}

Eigen::Vector2i LayerStack::steps(double rise, const Direction& direction) {
  const double shift = rise / std::max(direction.z(), kLeastCosine);
  // Rows grow towards -y. Half a texel up, as the ray begins in the middle of one.
  return {static_cast<int>(std::floor(shift * direction.x() + 0.5)),
          static_cast<int>(std::floor(-shift * direction.y() + 0.5))};
}

int moved_in_tile(int width, int height, int texel, const Eigen::Vector2i& steps) {
  const int column = wrapped(texel % width + steps.x(), width);
  const int row = wrapped(texel / width + steps.y(), height);
  return row * width + column;
}

int LayerStack::moved(int texel, const Eigen::Vector2i& steps, const TexelMap* map) const {
  return map != nullptr ? moved_in_tile(map->width(), map->height(), texel, steps)
                        : moved_in_tile(width_, height_, texel, steps);
}

double LayerStack::arriving(int layer,
                            int texel,
                            const Direction& light,
                            const TexelMap* map) const {
  double share = 1.0;
  for (int above = layer - 1; above >= 0 && share > 0.0; --above) {
    const double rise =
        heights_[static_cast<std::size_t>(above)] - heights_[static_cast<std::size_t>(layer)];
    share *= transmittance(above, shown(moved(texel, steps(rise, light), map), map));
  }
  return share;
}

Eigen::Vector3d LayerStack::layer_radiance(int layer,
                                           int texel,
                                           const Direction& view,
                                           const Direction& light,
                                           const TexelMap* map) const {
  const auto values = stored(layer, shown(texel, map));
  const double cosine = colour_at(values.subspan<kNormal>(), 0).dot(light);
  if (!(cosine > 0.0)) return Eigen::Vector3d::Zero();
  const std::array<Eigen::half, kLobeValues> lobe{
      values[kLobe], values[kLobe + 1], values[kLobe + 2], values[kExponent]};
  const double arrived =
      arriving(layer, texel, light, map) + static_cast<float>(values[kDiffuseRadiance]);
  return (arrived * cosine) *
         (colour_at(values.subspan<kDiffuse>(), 0) +
          lobe_value(lobe, view.cwiseProduct(light)) * colour_at(values.subspan<kSpecular>(), 0));
}

Eigen::Vector3d LayerStack::radiance(int texel,
                                     const Direction& view,
                                     const Direction& light,
                                     const TexelMap* map) const {
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();
  if (!(light.z() > 0.0)) return seen;
  const Direction above{view.x(), view.y(), std::max(view.z(), 0.0)};
  double visible = 1.0;
  for (int layer = 0; layer < layer_count() && visible > 0.0; ++layer) {
    const int place = met(texel, layer, above, map);
    seen += visible * layer_radiance(layer, place, above, light, map);
    visible *= transmittance(layer, shown(place, map));
  }
  return seen;
}

ModelTexture LayerStack::texture() const {
  MaterialFrame frame;
  frame.width = width_;
  frame.height = height_;
  LayerWriter writer(texel_count(), kTexturesPerLayer * layer_count());
  for (int layer = 0; layer < layer_count(); ++layer)
    for (int texel = 0; texel < texel_count(); ++texel) {
      std::span<const Eigen::half> rest = stored(layer, texel);
      for (int i = 0; i < kTexturesPerLayer; ++i) {
        const std::size_t count = std::min<std::size_t>(4, rest.size());
        writer.put(kTexturesPerLayer * layer + i, texel, rest.first(count));
        rest = rest.subspan(count);
      }
    }
  return writer.texture("Layers", frame);
}

void LayerStack::add_to(Material::Contents& contents) const {
  contents.metadata["layers"] = fmt::format("{}", layer_count());
  contents.tensors.push_back(tensor_of("heights", {layer_count()}, heights_));
  contents.tensors.push_back(
      tensor_of("points", {layer_count(), texel_count(), kLayerValues}, values_));
}

Result<LayerStack> LayerStack::read(const SafetensorsFile& file, const MaterialFrame& frame) {
  VENEER_ASSIGN(const int layers, read_integer(file, "layers", 1, kMostLayers));
  VENEER_ASSIGN(const TensorView tensor, file.tensor("heights", DType::kF32, {layers}));
  const std::string where = file.path().string();
  const std::span<const float> heights = tensor.as<float>();
  const auto is_within = [](float h) { return std::abs(h) <= kMostHeight; };
  if (!std::ranges::all_of(heights, is_within) ||
      std::ranges::adjacent_find(heights, std::less_equal{}) != heights.end())
    return fail(Errc::kBadFormat,
                "reading {}: heights should fall from layer to layer, within {} texels",
                where,
                kMostHeight);
  LayerStack stack(frame.width, frame.height, {heights.begin(), heights.end()});
  VENEER_ASSIGN(stack.values_,
                read_halves(file, "points", {layers, frame.texel_count(), kLayerValues}));
  for (int layer = 0; layer < layers; ++layer)
    for (int texel = 0; texel < frame.texel_count(); ++texel) {
      const std::string_view fault =
          fault_of(stack.stored(layer, texel), layer == 0, layer == layers - 1);
      if (!fault.empty())
        return fail(Errc::kBadFormat,
                    "reading {}: points: texel {} of layer {} {}",
                    where,
                    texel,
                    layer,
                    fault);
    }
  return stack;
}

}  // namespace veneer::btf
