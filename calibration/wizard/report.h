// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <vector>

#include "calibration/wizard/step.h"

namespace veneer::calibration {

/// Everything that a calibration found, for programs and for the page. Colours for the screen are
/// sRGB of XYZ relative to the projector's white.
[[nodiscard]] nlohmann::ordered_json report_of(const WizardResults& results,
                                               const std::vector<StepReport>& steps,
                                               const Devices& devices);

/// One HTML file with pictures of it that needs nothing else.
[[nodiscard]] std::string report_page(const nlohmann::ordered_json& report);

}  // namespace veneer::calibration
