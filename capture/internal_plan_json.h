// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include <string>

#include "base/result.h"
#include "capture/plan.h"

namespace veneer::capture {

/// All of a plan, to the last bit.
[[nodiscard]] nlohmann::json json_of(const CapturePlan& plan);
/// Errors: kBadFormat (something missing or of another type), kInvalidOption (see check()).
[[nodiscard]] Result<CapturePlan> plan_from(const nlohmann::json& json);
/// The first thing in which two plans differ, in words: "exposure.step is 4, not 2".
[[nodiscard]] std::string difference(const nlohmann::json& there, const nlohmann::json& here);

}  // namespace veneer::capture
