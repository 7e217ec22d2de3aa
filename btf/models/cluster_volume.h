// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "base/result.h"
#include "btf/models/angular_grid.h"

namespace veneer::btf {

/// Where functions of (view, light), given at the nodes of two AngularGrids, stand in a volume
/// texture, so that the hardware interpolates in the view's two coordinates and one of the light's,
/// and a shader mixes two fetches for the last: cluster_volume.glsl.
///
/// A function takes view nodes in x and y and light nodes in z. Clusters stand side by side in x,
/// as many as a power of two allows, and go on below; a cluster may have several functions, each of
/// which has its own storey of all clusters in y. Where the views have one node, lights take its
/// place and z has one. Where the nodes in z have one row or one column, as for a light that is
/// fixed, the hardware interpolates all there is, and one fetch is enough.
///
/// Source: Schneider 2004, "Real-time BTF Rendering", section 6.2.
class ClusterVolume {
 public:
  ClusterVolume(int clusters, const GridShape& views, const GridShape& lights, int storeys);
  [[nodiscard]] int width() const { return width_; }    ///< texels
  [[nodiscard]] int height() const { return height_; }  ///< texels
  [[nodiscard]] int depth() const { return beyond().count(); }
  [[nodiscard]] std::size_t texel_count() const;
  /// Of one function at one place, 1 or 2.
  [[nodiscard]] int fetches() const { return beyond().columns > 1 && beyond().rows > 1 ? 2 : 1; }
  /// The texel of a pair of nodes, numbered as in AngularGrid.
  [[nodiscard]] std::size_t texel(int cluster, int storey, int view_node, int light_node) const;
  /// GLSL: the constants that cluster_volume.glsl reads.
  [[nodiscard]] std::string constants() const;

  /// Refuses, with `code`, volumes that GPUs might not take: over kMostBytes.
  [[nodiscard]] static Status check(double bytes, Errc code, std::string_view doing);
  static constexpr std::size_t kMostBytes = std::size_t{2} << 30U;

 private:
  [[nodiscard]] bool lights_in_plane() const { return views_.count() == 1; }
  // The grid in x and y, and the one in z.
  [[nodiscard]] const GridShape& plane() const { return lights_in_plane() ? lights_ : views_; }
  [[nodiscard]] const GridShape& beyond() const { return lights_in_plane() ? views_ : lights_; }

  GridShape views_;
  GridShape lights_;
  int storeys_;
  int shift_ = 0;  // 2^shift clusters side by side
  int width_ = 0;
  int height_ = 0;
};

}  // namespace veneer::btf
