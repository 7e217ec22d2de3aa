// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/plcc/plcc.h"

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
  const auto light_of = [spline](const ChannelRamp& ramp) {
    std::vector<double> luminance;
    for (const Xyz& light : ramp.light) luminance.push_back(light.y() / ramp.full().y());
    if (spline)
      return ChannelLight(ramp.full(),
                          {CubicHermite(ramp.drives, std::move(luminance), Slopes::kMonotone)});
    return ChannelLight(ramp.full(), {PiecewiseLinear(ramp.drives, std::move(luminance))});
  };
  int parameters = 0;
  for (const ChannelRamp& ramp : ramps) {
    if (!(ramp.full().y() > 0.0))
      return fail(Errc::kBadFormat,
                  "fitting {}: a channel has no luminance at full drive; check the instrument",
                  name);
    parameters += static_cast<int>(ramp.drives.size()) - 1 + 2;  // levels, chromaticity
  }
  return std::make_unique<AdditiveModel>(
      name, std::array{light_of(ramps[0]), light_of(ramps[1]), light_of(ramps[2])}, parameters);
}

}  // namespace

Result<std::unique_ptr<ColourModel>> fit_plcc(std::span<const PatchReading> patches,
                                              const Xyz& black) {
  return fit("plcc", false, patches, black);
}

Result<std::unique_ptr<ColourModel>> fit_plcc_spline(std::span<const PatchReading> patches,
                                                     const Xyz& black) {
  return fit("plcc-spline", true, patches, black);
}

}  // namespace veneer::calibration
