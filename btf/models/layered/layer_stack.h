// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <span>
#include <vector>

#include "base/result.h"
#include "base/safetensors.h"
#include "btf/material.h"
#include "btf/models/material_tensors.h"
#include "btf/texel_map.h"

namespace veneer::btf {

/// What one texel of one layer is made of. Its light is f (S + L_d) max(N . l, 0) in the sample's
/// unit, with f = K_d + K_s max(0, v^T C l)^k and S what arrives from the light through the layers
/// above.
struct LayerPoint {
  Eigen::Vector3f diffuse = Eigen::Vector3f::Zero();   ///< K_d, RGB, >= 0
  float transmittance = 1.0F;                          ///< 0 opaque, 1 clear
  Eigen::Vector3f specular = Eigen::Vector3f::Zero();  ///< K_s, RGB, >= 0
  float exponent = 1.0F;                               ///< k, kLeastExponent to kMostExponent
  Eigen::Vector3f lobe{-1.0F, -1.0F, 1.0F};            ///< the diagonal of C
  float diffuse_radiance = 0.0F;                       ///< L_d, >= 0; 0 in the top layer
  Eigen::Vector3f normal{0.0F, 0.0F, 1.0F};            ///< N, unit, local frame
};

/// The texel so many columns and rows from another, around the edges of a tile.
[[nodiscard]] int moved_in_tile(int width, int height, int texel, const Eigen::Vector2i& steps);

/// Numbers of a stored point: K_d, a; K_s, k; C, L_d; N.
inline constexpr int kLayerValues = 15;

/// A stack of semi-transparent layers, after Magda and Kriegman 2005 (their eq. 4): seen along a
/// view, the sum over layers of their light times the transmittance of what lies above. Each layer
/// is met where the ray through the reference plane meets its height (shear-warp under parallel
/// projection); texels are squares of one value, and the tile repeats.
///
/// Layers are numbered from the top. Heights are above the reference plane of the sample set, in
/// texels, and fall strictly. The lowest layer is opaque.
class LayerStack {
 public:
  /// Layers at most: a layer takes four textures.
  static constexpr int kMostLayers = 6;
  static constexpr float kMostHeight = 64.0F;  ///< texels, above or below
  /// Directions are followed as if no nearer to the horizon than this (cos theta): a shift is then
  /// at most 20 times a height.
  static constexpr double kLeastCosine = 0.05;

  /// All clear, the lowest layer opaque and black.
  /// @param heights  1 to kMostLayers, strictly falling, within kMostHeight.
  LayerStack(int width, int height, std::vector<float> heights);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] int texel_count() const { return width_ * height_; }
  [[nodiscard]] int layer_count() const { return static_cast<int>(heights_.size()); }
  [[nodiscard]] std::span<const float> heights() const { return heights_; }

  /// As stored.
  [[nodiscard]] LayerPoint point(int layer, int texel) const;
  /// Rounds to what is stored; the lowest layer's transmittance becomes 0, the top one's L_d too.
  void set_point(int layer, int texel, const LayerPoint& point);

  /// By how many columns and rows a ray along `direction` moves while it rises by `rise` texels,
  /// from the middle of a texel to the one that it meets.
  [[nodiscard]] static Eigen::Vector2i steps(double rise, const Direction& direction);

  // Where a map is given, what is called a texel below is a place of it: rays move on the map, and
  // each place that they meet shows a texel of the stack.

  /// The texel so many columns and rows from another, around the tile's edges.
  [[nodiscard]] int moved(int texel,
                          const Eigen::Vector2i& steps,
                          const TexelMap* map = nullptr) const;
  /// Where the ray through a texel of the reference plane meets a layer.
  [[nodiscard]] int met(int texel,
                        int layer,
                        const Direction& view,
                        const TexelMap* map = nullptr) const {
    return moved(texel, steps(heights_[static_cast<std::size_t>(layer)], view), map);
  }
  /// S: the share of a light that reaches a layer's texel through the layers above.
  [[nodiscard]] double arriving(int layer,
                                int texel,
                                const Direction& light,
                                const TexelMap* map = nullptr) const;
  /// What a layer's texel sends to the eye, without what lies above it. Light above the horizon.
  [[nodiscard]] Eigen::Vector3d layer_radiance(int layer,
                                               int texel,
                                               const Direction& view,
                                               const Direction& light,
                                               const TexelMap* map = nullptr) const;
  /// What is drawn; 0 for lights at and below the horizon. A view below it counts as on it.
  [[nodiscard]] Eigen::Vector3d radiance(int texel,
                                         const Direction& view,
                                         const Direction& light,
                                         const TexelMap* map = nullptr) const;

  /// An array of four RGBA textures for each layer: K_d, a; K_s, k; C, L_d; N, 0.
  [[nodiscard]] ModelTexture texture() const;
  void add_to(Material::Contents& contents) const;
  /// Errors: kBadFormat.
  [[nodiscard]] static Result<LayerStack> read(const SafetensorsFile& file,
                                               const MaterialFrame& frame);

 private:
  [[nodiscard]] std::span<const Eigen::half, kLayerValues> stored(int layer, int texel) const;
  [[nodiscard]] double transmittance(int layer, int texel) const;

  int width_;
  int height_;
  std::vector<float> heights_;
  std::vector<Eigen::half> values_;  // [layer][texel][kLayerValues]
};

}  // namespace veneer::btf
