// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <string>

#include "tracking/eye_offset.h"
#include "tracking/latency.h"

// What `veneer track eye` and `veneer track latency` found, in words and as JSON. The values to be
// used are there only where the checks were passed.
namespace veneer::cli {

/// Span, residual and spread in one line, for while it is measured.
[[nodiscard]] std::string line_of(const tracking::EyeOffset& offset);
/// line_of() and the line for scene.toml, or why there is none.
[[nodiscard]] std::string text_of(const tracking::EyeOffset& offset, const Status& good);
[[nodiscard]] nlohmann::ordered_json json_of(const tracking::EyeOffset& offset, const Status& good);

[[nodiscard]] std::string text_of(const tracking::Latency& latency, const Status& good);
[[nodiscard]] nlohmann::ordered_json json_of(const tracking::Latency& latency, const Status& good);

}  // namespace veneer::cli
