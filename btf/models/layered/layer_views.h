// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <span>
#include <vector>

#include "btf/models/fitted_pairs.h"
#include "btf/models/layered/layer_stack.h"
#include "btf/models/layered/point_solver.h"
#include "btf/sample_set.h"

namespace veneer::btf {

/// A stack while it is fitted, in floats, and what a sample set says of each of its points while
/// the others are held. Since a ray meets one texel of each layer, every sample belongs to one
/// point of each.
class LayerViews {
 public:
  /// All clear but the lowest layer. @param set, pairs  outlive this.
  LayerViews(const SampleSet& set, const FittedPairs& pairs, std::vector<float> heights);

  [[nodiscard]] int layer_count() const { return static_cast<int>(points_.size()); }
  [[nodiscard]] int texel_count() const { return frame_.texel_count(); }
  [[nodiscard]] std::size_t view_count() const { return u_.size(); }
  [[nodiscard]] const Eigen::ArrayX3f& lights() const { return lights_; }
  [[nodiscard]] const std::vector<LayerPoint>& points(int layer) const {
    return points_[static_cast<std::size_t>(layer)];
  }
  /// All points of a layer at once, since those of one layer do not see each other.
  void set_points(int layer, std::vector<LayerPoint> points);
  /// Whether layers shade those below; not at first.
  void set_shadows(bool shadows);

  [[nodiscard]] std::span<const float> heights() const { return heights_; }
  /// Moves a layer between its neighbours; its points stay where they are on it.
  void set_height(int layer, float height);
  /// Of what the stack as a whole sends, over every `stride`-th texel.
  [[nodiscard]] double squared_error(int stride) const;

  /// Of a point's eight neighbours in its layer the share that is opaque, 0 to 1.
  [[nodiscard]] double opaque_around(int layer, int texel) const;
  /// S of each light at a point.
  [[nodiscard]] Eigen::ArrayXf arriving(int layer, int texel) const;
  /// What some views say of a point. @param order  which. @param views  view_count(); those of
  /// order are filled.
  void look(int layer, int texel, std::span<const int> order, std::vector<PointView>& views) const;
  [[nodiscard]] LayerStack stack() const;

 private:
  void update_arrived(int layer);
  void read(int texel, std::size_t view, LightRows& rows) const;
  void add_radiance(
      int layer, int texel, const Eigen::ArrayX3f& u, float share, LightRows& rows) const;
  [[nodiscard]] const LayerPoint& point(int layer, int texel) const {
    return points_[static_cast<std::size_t>(layer)][static_cast<std::size_t>(texel)];
  }
  [[nodiscard]] int moved(int texel, const Eigen::Vector2i& steps) const;

  const SampleSet& set_;
  MaterialFrame frame_;
  std::vector<int> numbers_;  // of the pairs in the set
  Eigen::ArrayXf weights_;    // of the pairs, or none
  std::vector<float> heights_;
  bool shadows_ = false;
  std::vector<std::vector<LayerPoint>> points_;           // [layer][texel]
  std::vector<Eigen::ArrayXXf> arrived_;                  // [layer], lights x texels: S + L_d
  std::vector<std::vector<Eigen::Vector2i>> view_steps_;  // [layer][view]
  Eigen::ArrayX3f lights_;                                // [light][3]
  std::vector<Eigen::ArrayX3f> u_;                        // [view]
};

}  // namespace veneer::btf
