// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/plvc/plvc.h"

#include <array>
#include <string_view>
#include <utility>
#include <vector>

#include "calibration/colour/additive_model.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

Result<std::unique_ptr<ColourModel>> fit(std::string_view name,
                                         bool spline,
                                         std::span<const PatchReading> patches,
                                         const Xyz& black) {
  VENEER_ASSIGN(const ChannelRamps ramps, read_ramps(patches, black));
  int parameters = 0;
  const auto light_of = [spline, &parameters](const ChannelRamp& ramp) {
    std::vector<DriveCurve> curves;
    for (Eigen::Index component = 0; component < 3; ++component) {
      std::vector<double> values;
      for (const Xyz& light : ramp.light) values.push_back(light[component]);
      if (spline)
        curves.emplace_back(CubicHermite(ramp.drives, std::move(values), Slopes::kSmooth));
      else
        curves.emplace_back(PiecewiseLinear(ramp.drives, std::move(values)));
    }
    parameters += 3 * (static_cast<int>(ramp.drives.size()) - 1);
    return ChannelLight(Eigen::Matrix3d::Identity(), std::move(curves));
  };
  std::array channels{light_of(ramps[0]), light_of(ramps[1]), light_of(ramps[2])};
  return std::make_unique<AdditiveModel>(name, std::move(channels), parameters);
}

}  // namespace

Result<std::unique_ptr<ColourModel>> fit_plvc(std::span<const PatchReading> patches,
                                              const Xyz& black) {
  return fit("plvc", false, patches, black);
}

Result<std::unique_ptr<ColourModel>> fit_plvc_spline(std::span<const PatchReading> patches,
                                                     const Xyz& black) {
  return fit("plvc-spline", true, patches, black);
}

}  // namespace veneer::calibration
