// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/layer_views.h"

#include <numeric>

#include "base/parallel.h"

namespace veneer::btf {
namespace {

constexpr std::int64_t kGrain = 64;  // texels of a piece of work

std::vector<Eigen::Vector2i> steps_of(const DirectionSet& views, float height) {
  std::vector<Eigen::Vector2i> steps;
  for (const Direction& view : views) steps.push_back(LayerStack::steps(height, view));
  return steps;
}

}  // namespace

LayerViews::LayerViews(const SampleSet& set, const FittedPairs& pairs, std::vector<float> heights)
    : set_(set),
      frame_(pairs.frame()),
      numbers_(pairs.numbers(set.info())),
      heights_(std::move(heights)) {
  if (!pairs.weights().empty()) weights_ = pairs.all_weights();
  const auto lights = static_cast<Eigen::Index>(frame_.lights.size());
  lights_.resize(lights, 3);
  for (Eigen::Index i = 0; i < lights; ++i)
    lights_.row(i) = frame_.lights[static_cast<std::size_t>(i)].transpose().cast<float>();
  for (const Direction& view : frame_.views)
    u_.emplace_back(lights_.rowwise() * view.transpose().cast<float>().array());
  const auto texels = static_cast<std::size_t>(frame_.texel_count());
  for (const float height : heights_) {
    view_steps_.push_back(steps_of(frame_.views, height));
    points_.emplace_back(texels);
    arrived_.push_back(Eigen::ArrayXXf::Ones(lights, frame_.texel_count()));
  }
  for (LayerPoint& lowest : points_.back()) lowest.transmittance = 0.0F;
}

int LayerViews::moved(int texel, const Eigen::Vector2i& steps) const {
  return moved_in_tile(frame_.width, frame_.height, texel, steps);
}

void LayerViews::set_points(int layer, std::vector<LayerPoint> points) {
  points_[static_cast<std::size_t>(layer)] = std::move(points);
  update_arrived(layer);
  if (!shadows_) return;
  for (int below = layer + 1; below < layer_count(); ++below) update_arrived(below);
}

void LayerViews::set_shadows(bool shadows) {
  shadows_ = shadows;
  for (int layer = 0; layer < layer_count(); ++layer) update_arrived(layer);
}

void LayerViews::set_height(int layer, float height) {
  heights_[static_cast<std::size_t>(layer)] = height;
  view_steps_[static_cast<std::size_t>(layer)] = steps_of(frame_.views, height);
  if (shadows_) set_shadows(true);
}

double LayerViews::squared_error(int stride) const {
  const int count = (frame_.texel_count() + stride - 1) / stride;
  std::vector<double> errors(static_cast<std::size_t>(count));
  parallel_for(count, kGrain, [&](std::int64_t begin, std::int64_t end) {
    LightRows rest;
    for (auto i = begin; i < end; ++i) {
      const auto base = static_cast<int>(i * stride);
      for (std::size_t v = 0; v < frame_.views.size(); ++v) {
        read(base, v, rest);
        float visible = 1.0F;
        for (int layer = 0; layer < layer_count() && visible > 0.0F; ++layer) {
          const int place = moved(base, view_steps_[static_cast<std::size_t>(layer)][v]);
          add_radiance(layer, place, u_[v], -visible, rest);
          visible *= point(layer, place).transmittance;
        }
        errors[static_cast<std::size_t>(i)] += double(rest.square().sum());
      }
    }
  });
  // In the texels' order, so that the sum is the same on any number of threads.
  return std::accumulate(errors.begin(), errors.end(), 0.0);
}

double LayerViews::opaque_around(int layer, int texel) const {
  double opaque = 0.0;
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x)
      if (x != 0 || y != 0)
        opaque += 1.0 - double(point(layer, moved(texel, {x, y})).transmittance);
  return opaque / 8.0;
}

Eigen::ArrayXf LayerViews::arriving(int layer, int texel) const {
  Eigen::ArrayXf share = Eigen::ArrayXf::Ones(lights_.rows());
  if (!shadows_) return share;
  for (int above = 0; above < layer; ++above) {
    const double rise = double(heights_[static_cast<std::size_t>(above)]) -
                        double(heights_[static_cast<std::size_t>(layer)]);
    for (Eigen::Index i = 0; i < share.size(); ++i)
      share[i] *=
          point(above,
                moved(texel, LayerStack::steps(rise, frame_.lights[static_cast<std::size_t>(i)])))
              .transmittance;
  }
  return share;
}

void LayerViews::update_arrived(int layer) {
  Eigen::ArrayXXf& arrived = arrived_[static_cast<std::size_t>(layer)];
  parallel_for(frame_.texel_count(), kGrain, [&](std::int64_t begin, std::int64_t end) {
    for (auto texel = static_cast<int>(begin); texel < end; ++texel)
      arrived.col(texel) = arriving(layer, texel) + point(layer, texel).diffuse_radiance;
  });
}

void LayerViews::add_radiance(
    int layer, int texel, const Eigen::ArrayX3f& u, float share, LightRows& rows) const {
  const LayerPoint& at = point(layer, texel);
  const bool shines = at.specular.maxCoeff() > 0.0F;
  if (!shines && !(at.diffuse.maxCoeff() > 0.0F)) return;
  thread_local Eigen::ArrayXf shine;
  thread_local Eigen::ArrayXf lobe;
  shine = (lights_.matrix() * at.normal).array().max(0.0F) *
          arrived_[static_cast<std::size_t>(layer)].col(texel) * share;
  if (shines) lobe_rows(at, u, lobe);
  for (int c = 0; c < 3; ++c) {
    if (shines)
      rows.col(c) += shine * (at.diffuse[c] + at.specular[c] * lobe);
    else
      rows.col(c) += shine * at.diffuse[c];
  }
}

void LayerViews::read(int texel, std::size_t view, LightRows& rows) const {
  const auto lights = static_cast<std::size_t>(lights_.rows());
  thread_local std::vector<float> measured;
  measured.resize(3 * lights);
  set_.rgb(texel, Part::kTotal, std::span(numbers_).subspan(view * lights, lights), measured);
  rows =
      Eigen::Map<const Eigen::Array<float, 3, Eigen::Dynamic>>(measured.data(), 3, lights_.rows())
          .transpose();
}

void LayerViews::look(int layer,
                      int texel,
                      std::span<const int> order,
                      std::vector<PointView>& views) const {
  const auto lights = static_cast<std::size_t>(lights_.rows());
  for (const int number : order) {
    const auto v = static_cast<std::size_t>(number);
    PointView& view = views[v];
    const int base = moved(texel, -view_steps_[static_cast<std::size_t>(layer)][v]);
    read(base, v, view.wanted);
    view.u = u_[v];
    if (weights_.size() > 0)
      view.weight = weights_.segment(static_cast<Eigen::Index>(v * lights), lights_.rows());
    view.below.setZero(lights_.rows(), 3);
    view.visible = 1.0F;
    for (int above = 0; above < layer && view.visible > 0.0F; ++above) {
      const int place = moved(base, view_steps_[static_cast<std::size_t>(above)][v]);
      add_radiance(above, place, view.u, -view.visible, view.wanted);
      view.visible *= point(above, place).transmittance;
    }
    float share = 1.0F;
    if (!(view.visible > 0.0F)) continue;
    for (int below = layer + 1; below < layer_count() && share > 0.0F; ++below) {
      const int place = moved(base, view_steps_[static_cast<std::size_t>(below)][v]);
      add_radiance(below, place, view.u, share, view.below);
      share *= point(below, place).transmittance;
    }
  }
}

LayerStack LayerViews::stack() const {
  LayerStack stack(frame_.width, frame_.height, heights_);
  for (int layer = 0; layer < layer_count(); ++layer)
    for (int texel = 0; texel < frame_.texel_count(); ++texel)
      stack.set_point(layer, texel, point(layer, texel));
  return stack;
}

}  // namespace veneer::btf
