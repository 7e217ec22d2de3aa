// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/white_segment/white_segment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "calibration/colour/cube_model.h"
#include "calibration/colour/pca_spline/pca_spline.h"
#include "calibration/colour/ramps.h"
#include "calibration/interpolation.h"

namespace veneer::calibration {
namespace {

class WhiteSegmentModel final : public CubeModel {
 public:
  WhiteSegmentModel(AdditiveModel core, std::array<CubicHermite, 3> segment, int greys)
      : core_(std::move(core)), segment_(std::move(segment)), greys_(greys) {}
  [[nodiscard]] std::string_view name() const override { return "white-segment"; }
  [[nodiscard]] int parameters() const override { return core_.parameters() + 3 * greys_; }

 private:
  [[nodiscard]] Xyz inside(const Eigen::Vector3d& drive) const override {
    const double least = core_.linear_drive(drive).minCoeff();
    return core_.forward(drive) + Xyz(segment_[0](least), segment_[1](least), segment_[2](least));
  }
  [[nodiscard]] Eigen::Matrix3d slope_inside(const Eigen::Vector3d& drive) const override {
    Eigen::Index channel = 0;
    const double least = core_.linear_drive(drive).minCoeff(&channel);
    Eigen::Matrix3d slope = core_.jacobian(drive);
    slope.col(channel) +=
        core_.linear_drive_slope(drive)[channel] *
        Xyz(segment_[0].slope_at(least), segment_[1].slope_at(least), segment_[2].slope_at(least));
    return slope;
  }
  AdditiveModel core_;
  std::array<CubicHermite, 3> segment_;
  int greys_;
};

}  // namespace

Result<std::unique_ptr<ColourModel>> fit_white_segment(std::span<const PatchReading> patches,
                                                       const Xyz& black) {
  VENEER_ASSIGN(AdditiveModel core, pca_spline(patches, black, 2));
  // By the least linear drive; greys of equal one (a flat start of the curves) become one.
  std::map<double, std::pair<Xyz, int>> beyond_core;
  bool has_white = false;
  for (const PatchReading& mixture : read_mixtures(patches, black)) {
    if (mixture.drive.minCoeff() != mixture.drive.maxCoeff()) continue;
    const double least = core.linear_drive(mixture.drive).minCoeff();
    if (!(least > 0.0)) continue;
    auto& [sum, count] = beyond_core.try_emplace(least, Xyz::Zero(), 0).first->second;
    sum += mixture.xyz - core.forward(mixture.drive);
    ++count;
    has_white = has_white || mixture.drive.x() == 1.0;
  }
  const auto greys = static_cast<int>(beyond_core.size());
  if (greys < kFewestGreys || !has_white)
    return fail(Errc::kBadFormat,
                "fitting white-segment: there are {} greys {} white; {} or more with white are "
                "needed: measure the grey axis",
                greys,
                has_white ? "with" : "without",
                kFewestGreys);
  std::vector<double> least{0.0};
  std::array<std::vector<double>, 3> light{{{0.0}, {0.0}, {0.0}}};
  for (const auto& [drive, sum_and_count] : beyond_core) {
    least.push_back(drive);
    const Xyz beyond = sum_and_count.first / sum_and_count.second;
    for (std::size_t c = 0; c < 3; ++c)
      light[c].push_back(std::max(beyond[static_cast<Eigen::Index>(c)], 0.0));
  }
  const auto curve_of = [&least](const std::vector<double>& values) {
    return CubicHermite(least, nearest_rising(values), Slopes::kMonotone);
  };
  return std::make_unique<WhiteSegmentModel>(
      std::move(core),
      std::array{curve_of(light[0]), curve_of(light[1]), curve_of(light[2])},
      greys);
}

}  // namespace veneer::calibration
