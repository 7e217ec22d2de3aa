// SPDX-License-Identifier: Apache-2.0
#include "quality/visible_difference.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "base/parallel.h"
#include "btf/mapped_material.h"
#include "render/compensation.h"

namespace veneer::quality {
namespace {

// The value under which the part `rank` of the weight lies.
double weighted_quantile(std::vector<std::pair<double, double>> values, double rank) {
  std::ranges::sort(values);
  double sum = 0;
  for (const auto& [value, weight] : values) sum += weight;
  double below = 0;
  for (const auto& [value, weight] : values)
    if ((below += weight) >= rank * sum) return value;
  return 0;
}

// Where each of `some` stands in `all`; nothing where one does not.
std::vector<int> places_in(const btf::DirectionSet& all, const btf::DirectionSet& some) {
  std::vector<int> places;
  for (const btf::Direction& direction : some) {
    // A file keeps single precision.
    constexpr double kSame = 1e-5;
    const auto found = std::ranges::find_if(
        all, [&](const btf::Direction& other) { return (other - direction).norm() < kSame; });
    if (found == all.end()) return {};
    places.push_back(static_cast<int>(found - all.begin()));
  }
  return places;
}

int texel_at(double repeats, int size) {
  const double part = repeats - std::floor(repeats);
  return std::clamp(static_cast<int>(part * size), 0, size - 1);
}

}  // namespace

VisibleDifferences::VisibleDifferences(const calibration::ProjectorProfile& profile,
                                       std::span<const Asked> asked,
                                       const btf::SampleSetInfo& set)
    : profile_(profile), asked_(asked), width_(set.width), height_(set.height) {}

Result<VisibleDifferences> VisibleDifferences::make(const calibration::ProjectorProfile& profile,
                                                    std::span<const Asked> asked,
                                                    const btf::SampleSetInfo& set) {
  VENEER_TRY(profile.check());
  VENEER_CHECK(!asked.empty());
  return VisibleDifferences(profile, asked, set);
}

std::vector<VisibleDifferences::Shown> VisibleDifferences::show(const Reflecting& material) const {
  render::RendererOptions options;
  options.dither = false;
  const render::Compensation compensation(profile_, options);
  const Eigen::Matrix3d drive_from_xyz = profile_.primaries.inverse();
  std::vector<Shown> shown(asked_.size());
  constexpr std::int64_t kGrain = 64;
  parallel_for(
      static_cast<std::int64_t>(asked_.size()), kGrain, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
          const Asked& asked = asked_[i];
          const int texel =
              texel_at(asked.repeats.y(), height_) * width_ + texel_at(asked.repeats.x(), width_);
          Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
          for (std::size_t k = 0; k < static_cast<std::size_t>(asked.lights); ++k) {
            shown[i].rgb[k] = material(texel, asked.view, asked.lit[k].light);
            rgb += shown[i].rgb[k].cwiseProduct(asked.lit[k].illuminance_rgb);
          }
          const Xyz target = xyz_from_srgb() * rgb / std::numbers::pi;
          const Eigen::Vector3d reflectance = profile_.reflectance_at(asked.pixel);
          const render::CompensatedPixel pixel =
              compensation.pixel(target, asked.geometry, asked.vignetting, reflectance, 0, 0, 0);
          for (int c = 0; c < 3; ++c) {
            const auto bracket = compensation.tone_levels()[static_cast<std::size_t>(c)].bracket(
                std::clamp(pixel.drive[c], 0.0, 1.0));
            shown[i].codes[c] = bracket.lower + bracket.fraction * (bracket.upper - bracket.lower);
          }
          const Xyz arriving =
              asked.geometry * asked.vignetting * (profile_.emitted(pixel.drive) + profile_.black);
          const Xyz of_map =
              profile_.primaries *
              (reflectance.asDiagonal() * (drive_from_xyz * (arriving + profile_.ambient)));
          shown[i].sent = profile_.surface * of_map;
        }
      });
  return shown;
}

void VisibleDifferences::set_reference(const Reflecting& truth) { reference_ = show(truth); }

VisibleDifference VisibleDifferences::of(const Reflecting& material) const {
  VENEER_CHECK(reference_.size() == asked_.size());
  const std::vector<Shown> shown = show(material);
  const Xyz white = profile_.white();
  std::vector<std::pair<double, double>> colours;
  std::vector<std::pair<double, double>> codes;
  VisibleDifference d;
  double sum = 0;
  double squares = 0;
  double squares_weight = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const double weight = asked_[i].weight;
    const double de00 =
        delta_e_2000(lab_from_xyz(shown[i].sent, white), lab_from_xyz(reference_[i].sent, white));
    const double steps = (shown[i].codes - reference_[i].codes).cwiseAbs().maxCoeff();
    colours.emplace_back(de00, weight);
    codes.emplace_back(steps, weight);
    sum += weight;
    d.de00_mean += weight * de00;
    d.codes_mean += weight * steps;
    d.de00_max = std::max(d.de00_max, de00);
    d.codes_max = std::max(d.codes_max, steps);
    for (std::size_t k = 0; k < static_cast<std::size_t>(asked_[i].lights); ++k) {
      squares += weight * (shown[i].rgb[k] - reference_[i].rgb[k]).squaredNorm() / 3;
      squares_weight += weight;
    }
  }
  d.de00_mean /= sum;
  d.codes_mean /= sum;
  d.de00_p95 = weighted_quantile(std::move(colours), 0.95);
  d.codes_p95 = weighted_quantile(std::move(codes), 0.95);
  d.rmse = std::sqrt(squares / squares_weight);
  return d;
}

Result<double> weighted_rmse(const btf::SampleSet& set,
                             const btf::Material& material,
                             const btf::PairWeights& weights) {
  const btf::SampleSetInfo& info = set.info();
  VENEER_TRY(
      btf::refuse_texel_map(material,
                            Errc::kBadFormat,
                            fmt::format("comparing a material with {}", set.path().string())));
  const std::vector<int> views = places_in(info.views, material.views());
  const std::vector<int> lights = places_in(info.lights, material.lights());
  if (material.width() != info.width || material.height() != info.height || views.empty() ||
      lights.empty())
    return fail(Errc::kBadFormat,
                "comparing a material with {}: it was fitted on another set, of {} x {} texels, {} "
                "views and {} lights",
                set.path().string(),
                material.width(),
                material.height(),
                material.views().size(),
                material.lights().size());
  // Of the pairs that the material keeps: where they stand in the set, and what they weigh.
  std::vector<std::size_t> pairs;
  std::vector<double> weight;
  for (const int view : views)
    for (const int light : lights) {
      pairs.push_back(static_cast<std::size_t>(view) * info.lights.size() +
                      static_cast<std::size_t>(light));
      weight.push_back(weights.weight.empty() ? 1.0 : double(weights.weight[pairs.back()]));
    }
  std::vector<double> squares(static_cast<std::size_t>(info.texel_count()));
  parallel_for(info.texel_count(), 16, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> truth(static_cast<std::size_t>(info.pair_count()) * 3);
    std::vector<float> fitted(pairs.size() * 3);
    for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
      set.rgb(texel, btf::Part::kTotal, truth);
      material.reconstruct(texel, fitted);
      double sum = 0;
      for (std::size_t i = 0; i < fitted.size(); ++i) {
        const double difference = double(fitted[i]) - double(truth[3 * pairs[i / 3] + i % 3]);
        sum += weight[i / 3] * difference * difference;
      }
      squares[static_cast<std::size_t>(texel)] = sum;
    }
  });
  const double all = std::accumulate(weight.begin(), weight.end(), 0.0);
  return std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.0) /
                   (3 * all * info.texel_count()));
}

}  // namespace veneer::quality
