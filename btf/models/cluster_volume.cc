// SPDX-License-Identifier: Apache-2.0
#include "btf/models/cluster_volume.h"

namespace veneer::btf {
namespace {

// Every GL 4.5 takes volumes of this many texels a side.
constexpr int kMostSide = 2048;

}  // namespace

ClusterVolume::ClusterVolume(int clusters, int view_nodes, int light_nodes, int storeys)
    : view_nodes_(view_nodes), light_nodes_(light_nodes), storeys_(storeys) {
  while ((1 << shift_) < clusters && (2 << shift_) * view_nodes <= kMostSide) ++shift_;
  const int across = 1 << shift_;
  width_ = across * view_nodes;
  height_ = storeys * ((clusters + across - 1) / across) * view_nodes;
}

std::size_t ClusterVolume::texel_count() const {
  return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_) *
         static_cast<std::size_t>(depth());
}

std::size_t ClusterVolume::texel(int cluster, int storey, int view_node, int light_node) const {
  const int x = (cluster & ((1 << shift_) - 1)) * view_nodes_ + view_node % view_nodes_;
  const int y =
      storey * (height_ / storeys_) + (cluster >> shift_) * view_nodes_ + view_node / view_nodes_;
  return (static_cast<std::size_t>(light_node) * static_cast<std::size_t>(height_) +
          static_cast<std::size_t>(y)) *
             static_cast<std::size_t>(width_) +
         static_cast<std::size_t>(x);
}

std::string ClusterVolume::constants() const {
  return fmt::format(
      "const vec2 kVolumeSize = vec2({}, {});\n"
      "const float kViewNodes = {}.0;\n"
      "const float kLightNodes = {}.0;\n"
      "const uint kClusterMask = {}u;\n"
      "const int kClusterShift = {};\n"
      "const float kStorey = 1.0 / {}.0;\n",
      width_,
      height_,
      view_nodes_,
      light_nodes_,
      (1 << shift_) - 1,
      shift_,
      storeys_);
}

Status ClusterVolume::check(double bytes, Errc code, std::string_view doing) {
  if (bytes <= double(kMostBytes)) return {};
  return fail(code,
              "{}: the volumes would take {:.1f} GiB on the GPU, over {:.0f} GiB; choose fewer "
              "clusters, fewer components or a smaller angular",
              doing,
              bytes / (1U << 30U),
              double(kMostBytes) / (1U << 30U));
}

}  // namespace veneer::btf
