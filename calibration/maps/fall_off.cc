// SPDX-License-Identifier: Apache-2.0
#include "calibration/maps/fall_off.h"

#include <algorithm>
#include <map>

#include "base/statistics.h"
#include "calibration/maps/internal_fall_off_model.h"

namespace veneer::calibration {
namespace {

using namespace internal;  // NOLINT(google-build-using-namespace): the other half of this file

/// Texels of the result at most, as in radiometry.cc: half a texel, which bilinear lookup cannot
/// extrapolate over, is then under 1 % of the raster.
constexpr int kVignettingWidth = 64;
constexpr int kVignettingHeight = 48;
constexpr float kLeastVignetting = 1e-3F;
/// A texel counts as covered if a sample lies within so many of it: 3 % of the raster, over which
/// no fall-off of a lens turns.
constexpr int kCoverRadius = 2;
/// How far a polynomial is followed beyond its samples, half diagonals.
constexpr double kReach = 0.08;
/// And how far the parabola is that follows, in the logarithm: a factor of 2.
constexpr double kMostExtrapolated = 0.7;
/// Fewer samples than this fix no fall-off.
constexpr std::int64_t kLeastSamples = 200;
constexpr int kLeastSamplesPerTerm = 10;

double half_diagonal(double width, double height) { return 0.5 * std::hypot(width, height); }

/// Sorts the samples out, and the good ones into rows.
class Sorter {
 public:
  Sorter(std::span<const FallOffSample> samples,
         const ProjectorGeometry& geometry,
         const FallOffOptions& options,
         const CameraFallOff& camera)
      : samples_(samples), geometry_(geometry), options_(options), camera_(camera) {}

  Data run(FallOff& result) {
    std::map<int, std::vector<std::size_t>> by_pose;
    for (std::size_t i = 0; i < samples_.size(); ++i)
      if (is_usable(samples_[i], result)) by_pose[samples_[i].pose].push_back(i);
    drop_dark(by_pose, result);
    mark_covered(by_pose, result);
    return rows_of(by_pose, result.used);
  }

 private:
  [[nodiscard]] bool is_usable(const FallOffSample& s, FallOff& result) const {
    VENEER_CHECK(s.pose >= 0);
    const bool finite = s.projector.allFinite() && s.camera.allFinite() && std::isfinite(s.lit) &&
                        std::isfinite(s.unlit) && s.x_in_projector.allFinite() &&
                        s.normal_in_projector.allFinite();
    const bool on_raster = s.projector.x() >= 0 && s.projector.x() <= geometry_.width &&
                           s.projector.y() >= 0 && s.projector.y() <= geometry_.height;
    if (!finite || !on_raster || !(s.x_in_projector.norm() > 0) ||
        !(s.normal_in_projector.norm() > 0)) {
      ++result.not_finite;
      return false;
    }
    if (options_.full_scale > 0 &&
        (s.lit >= options_.full_scale || s.unlit >= options_.full_scale)) {
      ++result.saturated;
      return false;
    }
    if (cosine(s) < options_.least_cosine) {
      ++result.grazing;
      return false;
    }
    return true;
  }

  static double cosine(const FallOffSample& s) {
    return std::abs(s.normal_in_projector.normalized().dot(s.x_in_projector.normalized()));
  }

  void drop_dark(std::map<int, std::vector<std::size_t>>& by_pose, FallOff& result) const {
    for (auto& [pose, indices] : by_pose) {
      std::vector<double> counts;
      counts.reserve(indices.size());
      for (const std::size_t i : indices) counts.push_back(samples_[i].lit - samples_[i].unlit);
      const double least = std::max(0.0, options_.least_light * quantile(std::move(counts), 0.95));
      result.dark += static_cast<std::int64_t>(std::erase_if(indices, [&](std::size_t i) {
        const double light = samples_[i].lit - samples_[i].unlit;
        return !(light > 0 && light >= least);
      }));
    }
    std::erase_if(by_pose, [](const auto& entry) { return entry.second.empty(); });
    for (const auto& [pose, indices] : by_pose)
      result.used += static_cast<std::int64_t>(indices.size());
  }

  void mark_covered(const std::map<int, std::vector<std::size_t>>& by_pose, FallOff& result) const {
    Image<std::uint8_t>& covered = result.covered;
    covered = Image<std::uint8_t>(std::min(kVignettingWidth, geometry_.width),
                                  std::min(kVignettingHeight, geometry_.height));
    Image<std::uint8_t> hit(covered.width(), covered.height());
    const auto texel = [](double at, int extent, int texels) {
      return std::min(static_cast<int>(at / extent * texels), texels - 1);
    };
    for (const auto& [pose, indices] : by_pose)
      for (const std::size_t i : indices)
        hit(texel(samples_[i].projector.x(), geometry_.width, hit.width()),
            texel(samples_[i].projector.y(), geometry_.height, hit.height())) = 1;
    for (int y = 0; y < hit.height(); ++y)
      for (int x = 0; x < hit.width(); ++x) {
        if (hit(x, y) == 0) continue;
        for (int v = std::max(0, y - kCoverRadius);
             v <= std::min(hit.height() - 1, y + kCoverRadius);
             ++v)
          for (int u = std::max(0, x - kCoverRadius);
               u <= std::min(hit.width() - 1, x + kCoverRadius);
               ++u)
            covered(u, v) = 1;
      }
  }

  [[nodiscard]] Data rows_of(const std::map<int, std::vector<std::size_t>>& by_pose,
                             std::int64_t used) const {
    // Every `thin`-th sample of each pose.
    const std::int64_t thin =
        std::max<std::int64_t>(1, (used + options_.most_samples - 1) / options_.most_samples);
    Data data;
    std::vector<std::size_t> kept;
    for (const auto& [pose, indices] : by_pose) {
      data.pose.push_back(pose);
      data.first.push_back(static_cast<std::int64_t>(kept.size()));
      for (std::size_t i = 0; i < indices.size(); i += static_cast<std::size_t>(thin))
        kept.push_back(indices[i]);
    }
    data.first.push_back(static_cast<std::int64_t>(kept.size()));
    data.rows.resize(kRow, static_cast<Eigen::Index>(kept.size()));
    data.light_weight.resize(static_cast<Eigen::Index>(kept.size()));
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const FallOffSample& s = samples_[kept[i]];
      auto row = data.rows.col(static_cast<Eigen::Index>(i));
      row.head<kRasterTerms>() = raster_terms(geometry_, s.projector);
      const double rho_squared =
          (s.camera - camera_.centre).squaredNorm() / std::pow(camera_.half_diagonal_px, 2);
      for (int term = 0; term < kCameraTerms; ++term)
        row[kRasterTerms + term] = std::pow(rho_squared, term + 1);
      row[kValue] =
          std::log(s.lit - s.unlit) - std::log(cosine(s) / s.x_in_projector.squaredNorm());
      data.light_weight[static_cast<Eigen::Index>(i)] = s.lit - s.unlit;
    }
    // Relative to the pose's median, above which noise is the board's more than the photons'.
    for (std::size_t pose = 0; pose < data.pose.size(); ++pose) {
      auto weight =
          data.light_weight.segment(data.first[pose], data.first[pose + 1] - data.first[pose]);
      const double median = quantile({weight.begin(), weight.end()}, 0.5);
      weight = (weight.array() / median).min(1.0);
    }
    return data;
  }

  std::span<const FallOffSample> samples_;
  const ProjectorGeometry& geometry_;
  const FallOffOptions& options_;
  const CameraFallOff& camera_;
};

/// @param parabola  coefficients of the lowest order, which is what the fall-off follows far from
///                  all samples.
void draw_vignetting(const ProjectorGeometry& geometry,
                     const Row& coefficients,
                     const Row& parabola,
                     FallOff& result) {
  const int width = result.covered.width();
  const int height = result.covered.height();
  const auto centre = [&](int x, int y) {
    return Eigen::Vector2d((x + 0.5) / width * geometry.width,
                           (y + 0.5) / height * geometry.height);
  };
  std::vector<Eigen::Vector2d> covered;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (result.covered(x, y) != 0) covered.push_back(centre(x, y));
  const double unit = half_diagonal(geometry.width, geometry.height);
  const auto value = [&](const Row& of, const Eigen::Vector2d& pixel) {
    return raster_terms(geometry, pixel).dot(of.head<kRasterTerms>());
  };

  result.vignetting = Image<float>(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d at = centre(x, y);
      Eigen::Vector2d border = at;  // how far the polynomial is followed
      if (result.covered(x, y) == 0) {
        const Eigen::Vector2d nearest = *std::ranges::min_element(
            covered, {}, [&](const Eigen::Vector2d& other) { return (other - at).squaredNorm(); });
        const double distance = (at - nearest).norm() / unit;
        result.most_extrapolated = std::max(result.most_extrapolated, distance);
        if (distance > kReach) border = nearest + (at - nearest) * (kReach / distance);
      }
      const double beyond = std::clamp(
          value(parabola, at) - value(parabola, border), -kMostExtrapolated, kMostExtrapolated);
      result.vignetting(x, y) = std::max(
          static_cast<float>(std::exp(value(coefficients, border) + beyond)), kLeastVignetting);
    }
  result.coverage = static_cast<double>(covered.size()) / (width * height);
}

void add_warnings(FallOff& result) {
  constexpr double kLeastCoverage = 0.9;
  constexpr double kMostOutliers = 0.1;
  constexpr double kMostResidual = 0.05;
  if (result.coverage < kLeastCoverage)
    result.warnings.push_back(
        fmt::format("the board reached {:.0f} % of the raster; the rest is extrapolated: hold it "
                    "in the parts that it did not reach",
                    100 * result.coverage));
  if (result.covered(result.covered.width() / 2, result.covered.height() / 2) == 0)
    result.warnings.push_back(
        "the board never lay at the raster's centre, which the fall-off is relative to");
  if (static_cast<double>(result.outliers) > kMostOutliers * static_cast<double>(result.fitted))
    result.warnings.push_back(fmt::format(
        "{:.0f} % of the samples do not fit; is the board matte, and nothing else in the picture?",
        100.0 * static_cast<double>(result.outliers) / static_cast<double>(result.fitted)));
  if (result.residual_rms > kMostResidual)
    result.warnings.push_back(fmt::format(
        "the samples scatter by {:.1f} %; expose longer, or check that the counts are linear",
        100 * result.residual_rms));
}

}  // namespace

double CameraFallOff::operator()(const Eigen::Vector2d& pixel) const {
  const double square = (pixel - centre).squaredNorm() / (half_diagonal_px * half_diagonal_px);
  return std::exp(square *
                  (coefficients[0] + square * (coefficients[1] + square * coefficients[2])));
}

Status FallOffOptions::check() const {
  if (camera_width <= 0 || camera_height <= 0)
    return fail(Errc::kInvalidOption,
                "the camera's picture is {} x {} pixels; give its size",
                camera_width,
                camera_height);
  if (!(full_scale >= 0))
    return fail(Errc::kInvalidOption, "full_scale {} is not 0 or more", full_scale);
  if (!(least_light >= 0 && least_light <= 0.9))
    return fail(Errc::kInvalidOption, "least_light {} is not from 0 to 0.9", least_light);
  if (!(least_cosine >= 0.05 && least_cosine <= 0.95))
    return fail(Errc::kInvalidOption, "least_cosine {} is not from 0.05 to 0.95", least_cosine);
  if (!(most_inflation > 1))
    return fail(Errc::kInvalidOption, "most_inflation {} is not above 1", most_inflation);
  if (most_samples < 1000)
    return fail(Errc::kInvalidOption, "most_samples {} is below 1000", most_samples);
  return {};
}

Result<FallOff> measure_fall_off(std::span<const FallOffSample> samples,
                                 const ProjectorGeometry& geometry,
                                 const FallOffOptions& options) {
  constexpr std::string_view kDoing = "measuring the fall-off";
  if (const Status valid = options.check(); !valid) return fail_while(kDoing, valid.error());
  if (geometry.width <= 0 || geometry.height <= 0)
    return fail(Errc::kInvalidOption,
                "{}: the raster is {} x {} pixels",
                kDoing,
                geometry.width,
                geometry.height);

  FallOff result;
  result.camera.half_diagonal_px = half_diagonal(options.camera_width, options.camera_height);
  result.camera.centre =
      options.camera_centre.allFinite()
          ? options.camera_centre
          : Eigen::Vector2d(0.5 * options.camera_width, 0.5 * options.camera_height);
  const Data data = Sorter(samples, geometry, options, result.camera).run(result);
  result.fitted = data.size();
  if (result.fitted < kLeastSamples)
    return fail(Errc::kBadFormat,
                "{}: of {} samples {} are of use ({} saturated, {} dark, {} grazing, {} without "
                "values or off the raster), and {} are needed; expose so that the board is neither "
                "dark nor saturated, and hold it square to the projector",
                kDoing,
                samples.size(),
                result.fitted,
                result.saturated,
                result.dark,
                result.grazing,
                result.not_finite,
                kLeastSamples);
  if (options.fit_camera && data.pose.size() < 2)
    return fail(Errc::kBadFormat,
                "{}: from one pose of the board the projector's fall-off cannot be told from the "
                "camera's; hold the board at several distances and tilts, or correct the camera's "
                "fall-off beforehand",
                kDoing);

  std::vector<Model> models;
  for (const int order : kOrders) {
    if (order > kOrders.front() && terms_of(order) * kLeastSamplesPerTerm > result.fitted) break;
    for (int terms = options.fit_camera ? 1 : 0; terms <= (options.fit_camera ? kCameraTerms : 0);
         ++terms)
      models.push_back({order, terms});
  }
  // The largest model decides which samples are outliers for the choice among all of them.
  const Choice choice = choose_model(data, fit_robustly(data, models.back()), models);
  const Fit fit = fit_robustly(data, choice.model);

  result.order = choice.model.order;
  result.camera_terms = choice.model.camera_terms;
  result.held_out_rms = choice.held_out_rms;
  for (int term = 0; term < kCameraTerms; ++term)
    result.camera.coefficients.at(static_cast<std::size_t>(term)) =
        fit.coefficients[kRasterTerms + term];
  draw_vignetting(geometry,
                  fit.coefficients,
                  solve(fit.moments, {kOrders.front(), choice.model.camera_terms}),
                  result);

  std::vector<RasterTerms> texels;
  for (int y = 0; y < result.covered.height(); ++y)
    for (int x = 0; x < result.covered.width(); ++x)
      if (result.covered(x, y) != 0)
        texels.push_back(raster_terms(geometry,
                                      {(x + 0.5) / result.covered.width() * geometry.width,
                                       (y + 0.5) / result.covered.height() * geometry.height}));
  // Of the projector's most flexible polynomial: that a low order happens to be unable to imitate
  // the camera does not tell the two apart.
  result.inflation =
      inflation_of(fit.moments, {models.back().order, choice.model.camera_terms}, texels);
  if (!(result.inflation <= options.most_inflation))
    return fail(Errc::kBadFormat,
                "{}: the poses cannot tell the projector's fall-off from the camera's (errors grow "
                "{:.3g} times, {:.3g} are allowed): the board lay at about the same place in the "
                "camera's picture and on the raster; hold it at different distances and tilts, or "
                "correct the camera's fall-off beforehand",
                kDoing,
                result.inflation,
                options.most_inflation);

  double squares = 0;
  double weight = 0;
  for (std::int64_t i = 0; i < data.size(); ++i) {
    if (!(fit.weight[i] > 0)) {
      ++result.outliers;
      continue;
    }
    squares += data.light_weight[i] * fit.residual[i] * fit.residual[i];
    weight += data.light_weight[i];
  }
  result.residual_rms = weight > 0 ? std::sqrt(squares / weight) : 0.0;
  result.gains.assign(static_cast<std::size_t>(data.pose.back()) + 1, 0.0);
  for (std::size_t pose = 0; pose < data.pose.size(); ++pose)
    result.gains[static_cast<std::size_t>(data.pose[pose])] =
        std::exp(fit.log_gains[pose] - fit.log_gains.front());
  add_warnings(result);
  return result;
}

}  // namespace veneer::calibration
