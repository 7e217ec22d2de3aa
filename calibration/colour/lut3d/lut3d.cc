// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/lut3d/lut3d.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "calibration/colour/cube_model.h"
#include "calibration/colour/lut3d/tetrahedral_lut.h"
#include "calibration/colour/pca_spline/pca_spline.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

class Lut3dModel final : public CubeModel {
 public:
  Lut3dModel(AdditiveModel curves, TetrahedralLut lut)
      : curves_(std::move(curves)), lut_(std::move(lut)) {}
  [[nodiscard]] std::string_view name() const override { return "lut3d"; }
  [[nodiscard]] int parameters() const override {
    const int n = lut_.nodes();
    return curves_.parameters() + 3 * (n * n * n - 1);
  }
  [[nodiscard]] std::optional<Vector3d> direct_inverse(const Xyz& xyz) const override {
    const std::optional<Vector3d> linear = lut_.inverse(xyz);
    if (!linear) return std::nullopt;
    return curves_.direct_inverse(curves_.primaries() * *linear);
  }

 private:
  [[nodiscard]] Xyz inside(const Vector3d& drive) const override {
    return lut_(curves_.linear_drive(drive));
  }
  [[nodiscard]] Eigen::Matrix3d slope_inside(const Vector3d& drive) const override {
    return lut_.slope_at(curves_.linear_drive(drive)) *
           curves_.linear_drive_slope(drive).asDiagonal();
  }
  AdditiveModel curves_;  // only what it says of single channels is used
  TetrahedralLut lut_;
};

/// Light above black by drive, single channels among it.
class Light {
 public:
  Light(const ChannelRamps& ramps, std::span<const PatchReading> mixtures) {
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < ramps[c].drives.size(); ++i) {
        std::array<double, 3> drive{};
        drive[c] = ramps[c].drives[i];
        light_[drive] = ramps[c].light[i];
      }
    }
    for (const PatchReading& mixture : mixtures)
      light_[{mixture.drive.x(), mixture.drive.y(), mixture.drive.z()}] = mixture.xyz;
  }
  [[nodiscard]] const Xyz* at(double r, double g, double b) const {
    const auto found = light_.find({r, g, b});
    return found == light_.end() ? nullptr : &found->second;
  }

 private:
  std::map<std::array<double, 3>, Xyz> light_;
};

// The levels at which every secondary and grey was read, 0 among them.
std::vector<double> levels_of(const ChannelRamp& ramp, const Light& light) {
  std::vector<double> levels;
  for (const double v : ramp.drives) {
    const bool complete =
        v == 0.0 || (light.at(v, v, 0) != nullptr && light.at(v, 0, v) != nullptr &&
                     light.at(0, v, v) != nullptr && light.at(v, v, v) != nullptr);
    if (complete) levels.push_back(v);
  }
  return levels;
}

}  // namespace

Result<std::unique_ptr<ColourModel>> fit_lut3d(std::span<const PatchReading> patches,
                                               const Xyz& black) {
  VENEER_ASSIGN(const ChannelRamps ramps, read_ramps(patches, black));
  VENEER_ASSIGN(AdditiveModel curves, pca_spline(patches, black, 1));
  const Light light(ramps, read_mixtures(patches, black));
  const std::vector<double> levels = levels_of(ramps[0], light);
  constexpr std::size_t kFewestNodes = 3;
  if (levels.size() < kFewestNodes || levels.back() != 1.0)
    return fail(Errc::kBadFormat,
                "fitting lut3d: there is no cube of mixtures; measure all mixtures of {} levels or "
                "more, 0 and full drive among them",
                kFewestNodes);
  std::vector<Xyz> values;
  int missing = 0;
  for (const double b : levels) {
    for (const double g : levels) {
      for (const double r : levels) {
        const Xyz* const xyz = light.at(r, g, b);
        if (xyz == nullptr) ++missing;
        values.push_back(xyz == nullptr ? Xyz::Zero() : *xyz);
      }
    }
  }
  if (missing > 0)
    return fail(Errc::kBadFormat,
                "fitting lut3d: {} of the {} mixtures of {} levels are missing; measure them",
                missing,
                values.size(),
                levels.size());
  std::array<std::vector<double>, 3> axes;
  for (const double level : levels) {
    const Vector3d linear = curves.linear_drive(Vector3d::Constant(level));
    for (std::size_t c = 0; c < 3; ++c) axes[c].push_back(linear[static_cast<Eigen::Index>(c)]);
  }
  for (std::vector<double>& axis : axes) {
    axis.back() = 1.0;  // is, but for rounding
    if (std::ranges::adjacent_find(axis, std::ranges::greater_equal{}) != axis.end())
      return fail(Errc::kBadFormat,
                  "fitting lut3d: a channel sends the same light at two levels of the cube; choose "
                  "levels farther apart");
  }
  return std::make_unique<Lut3dModel>(std::move(curves),
                                      TetrahedralLut(std::move(axes), std::move(values)));
}

}  // namespace veneer::calibration
