// SPDX-License-Identifier: Apache-2.0
#include "btf/models/cluster_volume.h"

#include <utility>

namespace veneer::btf {
namespace {

// Every GL 4.5 takes volumes of this many texels a side.
constexpr int kMostSide = 2048;

}  // namespace

ClusterVolume::ClusterVolume(int clusters,
                             const GridShape& views,
                             const GridShape& lights,
                             int storeys)
    : views_(views), lights_(lights), storeys_(storeys) {
  const auto [box, columns, rows] = plane();
  while ((1 << shift_) < clusters && (2 << shift_) * columns <= kMostSide) ++shift_;
  const int across = 1 << shift_;
  width_ = across * columns;
  height_ = storeys * ((clusters + across - 1) / across) * rows;
}

std::size_t ClusterVolume::texel_count() const {
  return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_) *
         static_cast<std::size_t>(depth());
}

std::size_t ClusterVolume::texel(int cluster, int storey, int view_node, int light_node) const {
  const int node = lights_in_plane() ? light_node : view_node;
  const int slice = lights_in_plane() ? view_node : light_node;
  const auto [box, columns, rows] = plane();
  const int x = (cluster & ((1 << shift_) - 1)) * columns + node % columns;
  const int y = storey * (height_ / storeys_) + (cluster >> shift_) * rows + node / columns;
  return (static_cast<std::size_t>(slice) * static_cast<std::size_t>(height_) +
          static_cast<std::size_t>(y)) *
             static_cast<std::size_t>(width_) +
         static_cast<std::size_t>(x);
}

std::string ClusterVolume::constants() const {
  std::string text;
  for (const auto& [name, grid] : {std::pair{"View", &views_}, {"Light", &lights_}}) {
    const Eigen::Vector2d scale = grid->scale();
    text += fmt::format(
        "const vec2 k{0}Nodes = vec2({1}, {2});\n"
        "const vec2 k{0}From = vec2({3:.9g}, {4:.9g});\n"
        "const vec2 k{0}Scale = vec2({5:.9g}, {6:.9g});\n",
        name,
        grid->columns,
        grid->rows,
        grid->box.u_min,
        grid->box.v_min,
        scale.x(),
        scale.y());
  }
  return text + fmt::format(
                    "const vec2 kVolumeSize = vec2({}, {});\n"
                    "const bool kLightsInPlane = {};\n"
                    "const bool kOneFetch = {};\n"
                    "const uint kClusterMask = {}u;\n"
                    "const int kClusterShift = {};\n"
                    "const float kStorey = 1.0 / {}.0;\n",
                    width_,
                    height_,
                    lights_in_plane(),
                    fetches() == 1,
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
