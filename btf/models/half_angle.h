// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "btf/direction.h"
#include "btf/models/matrix_product.h"

namespace veneer::btf {

/// Functions of (view, light) that are isotropic, reciprocal and mirror-symmetric once the light's
/// cosine is divided out: f(view, light) = cos(theta_l) g(theta_h, theta_d, phi_d). g is given at
/// the nodes of a grid of three coordinates in [0, 1], all free of trigonometry,
///
///     u = sqrt(2) sin(theta_h / 2),   v = sqrt(2) sin(theta_d / 2),   w = cos^2(phi_d),
///
/// of the half vector's angle to the normal, the light's to the half vector, and the azimuth of the
/// light about it, where w = 0 and one node hold every azimuth at the poles u = 0 and v = 0. So one
/// fetch that the hardware filters draws four functions: half_angle.glsl.
///
/// Source: Rusinkiewicz 1998, "A New Change of Variables for Efficient BRDF Representation";
/// symmetries of phi_d as in its section 4.
namespace half_angle {

inline constexpr int kHalfNodes = 32;
inline constexpr int kDifferenceNodes = 12;
inline constexpr int kAzimuthNodes = 4;
inline constexpr int kNodes = kHalfNodes * kDifferenceNodes * kAzimuthNodes;

/// Node (u, v, w) has index (w * kDifferenceNodes + v) * kHalfNodes + u.
struct NodeWeights {
  std::array<int, 8> node{};
  std::array<double, 8> weight{};
};

/// (u, v, w) of a pair. Domain: view and light at or above the horizon, of length 1; a view below
/// it is taken to it. Where both are equal or their half vector is the normal, w is 0.
[[nodiscard]] Eigen::Vector3d coordinates(const Direction& view, const Direction& light);
/// The nodes that make g at a pair, trilinear.
[[nodiscard]] NodeWeights weights(const Direction& view, const Direction& light);

/// The g that come closest to functions at measured pairs in the squares; where no pair tells, as
/// even as can be. @param values  [function][view * lights + light], finite.
/// @return [function][kNodes]
[[nodiscard]] RowMatrix fill(const DirectionSet& views,
                             const DirectionSet& lights,
                             const RowMatrix& values);
/// The functions of given g at measured pairs. @param nodes  [function][kNodes]
[[nodiscard]] RowMatrix values_at(const DirectionSet& views,
                                  const DirectionSet& lights,
                                  const RowMatrix& nodes);

/// Where the nodes of clusters stand in a volume texture: u along x, v along y, w along z, clusters
/// side by side in x, as many as a power of two allows, and go on below.
class Volume {
 public:
  explicit Volume(int clusters);
  [[nodiscard]] int width() const { return kHalfNodes << shift_; }  ///< texels
  [[nodiscard]] int height() const { return kDifferenceNodes * rows_; }
  [[nodiscard]] static int depth() { return kAzimuthNodes; }
  [[nodiscard]] std::size_t texel_count() const;
  [[nodiscard]] std::size_t texel(int cluster, int node) const;
  /// GLSL: the constants that half_angle.glsl reads.
  [[nodiscard]] std::string constants() const;

 private:
  int shift_ = 0;  // 2^shift clusters side by side
  int rows_ = 0;   // of clusters
};

}  // namespace half_angle
}  // namespace veneer::btf
