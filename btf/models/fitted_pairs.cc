// SPDX-License-Identifier: Apache-2.0
#include "btf/models/fitted_pairs.h"

#include <algorithm>
#include <numeric>

#include "btf/elevated_concentric.h"
#include "btf/spherical_interpolation.h"

namespace veneer::btf {
namespace {

// Places along each side of a box where is looked what it is interpolated from: finer than the
// triangles of any measured set.
constexpr int kPlaces = 65;
// A weight of an interpolation this small is rounding.
constexpr double kNoShare = 1e-9;
// Pairs that count less than so, against the one that counts most, leave no trace in float sums.
constexpr double kNoWeight = 1e-8;

// Marks the directions that those of a box are interpolated from.
void mark_needed(const DirectionSet& directions, const DirectionBox& box, std::vector<bool>& kept) {
  const SphericalInterpolator interpolator(directions, DirectionRole::kView);
  const auto place = [](double from, double to, int i) {
    return from + (to - from) * i / (kPlaces - 1);
  };
  for (int row = 0; row < kPlaces; ++row)
    for (int column = 0; column < kPlaces; ++column) {
      const DirectionWeights at = interpolator.weights(direction_from_square(
          {place(box.u_min, box.u_max, column), place(box.v_min, box.v_max, row)}));
      for (std::size_t i = 0; i < 3; ++i)
        if (at.weight[i] > kNoShare) kept[static_cast<std::size_t>(at.index[i])] = true;
    }
}

std::vector<int> numbers_of(const std::vector<bool>& kept) {
  std::vector<int> numbers;
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (kept[i]) numbers.push_back(static_cast<int>(i));
  return numbers;
}

DirectionSet chosen(const DirectionSet& directions, const std::vector<int>& numbers) {
  DirectionSet some;
  for (const int i : numbers) some.push_back(directions[static_cast<std::size_t>(i)]);
  return some;
}

}  // namespace

Result<FittedPairs> FittedPairs::of(const SampleSetInfo& info, const FitRegion* region) {
  FittedPairs pairs;
  pairs.frame_ = frame_of(info);
  if (region == nullptr) return pairs;
  VENEER_TRY(region->check(info));
  pairs.boxes_ = {region->views, region->lights};
  const std::vector<float>& weight = region->weights.weight;
  const bool weighted = !weight.empty();
  const std::size_t lights = info.lights.size();
  const double least = weighted ? kNoWeight * double(std::ranges::max(weight)) : 0.0;

  std::vector<bool> views_kept(info.views.size(), !weighted && region->views.is_all());
  std::vector<bool> lights_kept(lights, !weighted && region->lights.is_all());
  for (std::size_t i = 0; i < weight.size(); ++i)
    if (double(weight[i]) > least) views_kept[i / lights] = lights_kept[i % lights] = true;
  if (!region->views.is_all()) mark_needed(info.views, region->views, views_kept);
  if (!region->lights.is_all()) mark_needed(info.lights, region->lights, lights_kept);

  const std::vector<int> views = numbers_of(views_kept);
  const std::vector<int> of_lights = numbers_of(lights_kept);
  pairs.frame_.views = chosen(info.views, views);
  pairs.frame_.lights = chosen(info.lights, of_lights);
  const bool whole = views.size() == info.views.size() && of_lights.size() == lights;
  const float most = weighted ? std::ranges::max(weight) : 1.0F;
  for (const int view : views)
    for (const int light : of_lights) {
      const int pair = view * static_cast<int>(lights) + light;
      if (!whole) pairs.pairs_.push_back(pair);
      if (!weighted) continue;
      const float of_pair = weight[static_cast<std::size_t>(pair)];
      pairs.weights_.push_back(double(of_pair) > least ? of_pair / most : 0.0F);
    }
  if (std::ranges::all_of(pairs.weights_, [](float w) { return w == 1.0F; }))
    pairs.weights_.clear();
  return pairs;
}

std::vector<float> FittedPairs::column_weights(int channels) const {
  std::vector<float> columns;
  for (const float weight : weights_)
    columns.insert(columns.end(), static_cast<std::size_t>(channels), weight);
  return columns;
}

std::vector<float> FittedPairs::weights_everywhere() const {
  std::vector<float> weights = weights_;
  for (float& weight : weights) weight = std::max(weight, 1e-6F);
  return weights;
}

Eigen::ArrayXf FittedPairs::all_weights() const {
  if (weights_.empty()) return Eigen::ArrayXf::Ones(frame_.pair_count());
  return Eigen::Map<const Eigen::ArrayXf>(weights_.data(), frame_.pair_count());
}

std::vector<int> FittedPairs::numbers(const SampleSetInfo& info) const {
  if (!pairs_.empty()) return pairs_;
  std::vector<int> all(static_cast<std::size_t>(info.pair_count()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

void FittedPairs::rgb(const SampleSet& set, int texel, Part part, std::span<float> out) const {
  if (pairs_.empty()) return set.rgb(texel, part, out);
  set.rgb(texel, part, pairs_, out);
}

void FittedPairs::rgb(const SampleSet& set,
                      const TexelPyramid& pyramid,
                      int texel,
                      Part part,
                      std::span<float> out) const {
  if (pairs_.empty()) return pyramid_rgb(set, pyramid, texel, part, out);
  pyramid_rgb(set, pyramid, texel, part, pairs_, out);
}

}  // namespace veneer::btf
