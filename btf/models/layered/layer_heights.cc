// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/layer_heights.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "btf/models/layered/layer_stack.h"

namespace veneer::btf {
namespace {

constexpr int kMostFound = 4;        // layers where nobody says how many
constexpr double kSweepStep = 0.25;  // texels
constexpr double kMostSwept = 12.0;  // texels
// Of the variance at the median height: a texel whose least is not below says nothing of its
// height.
constexpr double kTelling = 0.5;
// Texels that say something, at least, of all.
constexpr double kLeastTelling = 0.02;
constexpr std::int64_t kGrain = 64;

// Each texel's picture in each view, under the mean of all lights and with the view's own
// brightness taken out: [view] of texels x 3.
std::vector<Eigen::ArrayX3f> pictures(const SampleSet& set, const FittedPairs& pairs) {
  const MaterialFrame& frame = pairs.frame();
  const auto views = static_cast<Eigen::Index>(frame.views.size());
  const auto lights = static_cast<Eigen::Index>(frame.lights.size());
  std::vector<Eigen::ArrayX3f> result(frame.views.size(), Eigen::ArrayX3f(frame.texel_count(), 3));
  parallel_for(frame.texel_count(), kGrain, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(3 * static_cast<std::size_t>(frame.pair_count()));
    for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
      pairs.rgb(set, texel, Part::kTotal, rgb);
      const Eigen::Map<const Eigen::Array3Xf> all(rgb.data(), 3, views * lights);
      for (Eigen::Index v = 0; v < views; ++v)
        result[static_cast<std::size_t>(v)].row(texel) =
            all.middleCols(v * lights, lights).rowwise().mean().transpose();
    }
  });
  for (Eigen::ArrayX3f& picture : result) {
    const Eigen::Array<float, 1, 3> mean = picture.colwise().mean();
    picture.rowwise() /= (mean > 0.0F).select(mean, 1.0F);
  }
  return result;
}

// For every texel the height at which it varies least, and how much that tells: 0 for nothing.
struct Found {
  double height = 0.0;
  double weight = 0.0;
};
std::vector<Found> sweep(const std::vector<Eigen::ArrayX3f>& pictures,
                         const MaterialFrame& frame,
                         double lowest,
                         double highest,
                         Progress& progress) {
  const int count = 1 + static_cast<int>(std::lround((highest - lowest) / kSweepStep));
  const auto moved = [&frame](int texel, const Eigen::Vector2i& steps) {
    return moved_in_tile(frame.width, frame.height, texel, steps);
  };
  Eigen::ArrayXXf variance(frame.texel_count(), count);
  progress.start("heights", count);
  parallel_for(count, 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto h = begin; h < end; ++h) {
      const double height = lowest + kSweepStep * static_cast<double>(h);
      Eigen::ArrayX3f sum = Eigen::ArrayX3f::Zero(frame.texel_count(), 3);
      Eigen::ArrayX3f squares = sum;
      for (std::size_t v = 0; v < pictures.size(); ++v) {
        const Eigen::Vector2i steps = LayerStack::steps(height, frame.views[v]);
        for (int texel = 0; texel < frame.texel_count(); ++texel) {
          const auto value = pictures[v].row(moved(texel, -steps));
          sum.row(texel) += value;
          squares.row(texel) += value.square();
        }
      }
      const float share = 1.0F / static_cast<float>(pictures.size());
      variance.col(h) = (squares * share - (sum * share).square()).max(0.0F).rowwise().sum();
      progress.advance(1);
    }
  });
  progress.finish("");

  std::vector<Found> found(static_cast<std::size_t>(frame.texel_count()));
  std::vector<float> row(static_cast<std::size_t>(count));
  for (int texel = 0; texel < frame.texel_count(); ++texel) {
    // Over a texel and its neighbours, since one alone is a few numbers.
    Eigen::ArrayXf around = Eigen::ArrayXf::Zero(count);
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) around += variance.row(moved(texel, {x, y})).transpose();
    Eigen::Index best = 0;
    const float least = around.minCoeff(&best);
    std::copy(around.begin(), around.end(), row.begin());
    std::nth_element(row.begin(), row.begin() + count / 2, row.end());
    const float median = row[static_cast<std::size_t>(count / 2)];
    if (!(median > 0.0F) || least > kTelling * median) continue;
    found[static_cast<std::size_t>(texel)] = {lowest + kSweepStep * double(best),
                                              1.0 - double(least / median)};
  }
  return found;
}

// The weighted k-means of numbers, from quantiles; falling. @param spread  their rms distance.
std::vector<double> centres(std::vector<Found> found, int count, double& spread) {
  std::ranges::sort(found, {}, &Found::height);
  const double total = std::accumulate(
      found.begin(), found.end(), 0.0, [](double s, const Found& f) { return s + f.weight; });
  // From the ends of the range inwards, so that a few far texels have a centre of their own.
  std::vector<double> centre;
  for (int i = 0; i < count; ++i) {
    const double low = found.front().height;
    const double high = found.back().height;
    centre.push_back(count == 1 ? 0.5 * (low + high)
                                : high + (low - high) * i / static_cast<double>(count - 1));
  }
  for (int round = 0; round < 50; ++round) {
    std::vector<double> sum(centre.size(), 0.0);
    std::vector<double> weight(centre.size(), 0.0);
    spread = 0.0;
    for (const Found& f : found) {
      std::size_t nearest = 0;
      for (std::size_t i = 1; i < centre.size(); ++i)
        if (std::abs(f.height - centre[i]) < std::abs(f.height - centre[nearest])) nearest = i;
      sum[nearest] += f.weight * f.height;
      weight[nearest] += f.weight;
      spread += f.weight * std::pow(f.height - centre[nearest], 2);
    }
    spread = std::sqrt(spread / total);
    for (std::size_t i = 0; i < centre.size(); ++i)
      if (weight[i] > 0.0) centre[i] = sum[i] / weight[i];
  }
  return centre;
}

std::vector<float> spread_evenly(const HeightRange& range, int count) {
  std::vector<float> heights;
  for (int i = 0; i < count; ++i)
    heights.push_back(static_cast<float>(
        count == 1 ? range.lowest
                   : range.highest + (range.lowest - range.highest) * i / double(count - 1)));
  return heights;
}

}  // namespace

LayerHeights layer_heights(const SampleSet& set,
                           const FittedPairs& pairs,
                           const FitOptions& options,
                           Progress& progress) {
  const MaterialFrame& frame = pairs.frame();
  const double most = std::min(kMostSwept, 0.25 * std::min(frame.width, frame.height));
  const HeightRange range = options.heights.value_or(HeightRange{-most, most});
  std::vector<Found> found =
      sweep(pictures(set, pairs), frame, range.lowest, range.highest, progress);
  const auto all = static_cast<double>(found.size());
  std::erase_if(found, [](const Found& f) { return f.weight == 0.0; });
  const bool tells = static_cast<double>(found.size()) >= kLeastTelling * all;
  double depth = 0.0;
  if (tells) centres(found, 1, depth);
  if (options.heights && options.layers > 0)
    return {spread_evenly(*options.heights, options.layers), depth};
  if (!tells) {
    // Whatever was asked lies close together.
    const int count = std::max(options.layers, 1);
    const double half = 0.5 * kHeightResolution * (count - 1);
    return {spread_evenly({-half, half}, count), depth};
  }
  std::vector<double> best;
  const int least = std::max(options.layers, 1);
  const int most_layers = options.layers > 0 ? options.layers : kMostFound;
  for (int count = least; count <= most_layers; ++count) {
    double spread = 0.0;
    best = centres(found, count, spread);
    if (spread < kHeightResolution) break;
  }
  std::vector<float> heights(best.begin(), best.end());
  std::ranges::sort(heights, std::greater{});
  // Layers that no texel took lie at one place with others.
  for (std::size_t i = 1; i < heights.size(); ++i)
    heights[i] = std::min(heights[i], heights[i - 1] - static_cast<float>(kSweepStep));
  return {heights, depth};
}

}  // namespace veneer::btf
