// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <string>

#include "projector/outputs/kms/displays.h"

namespace veneer::cli {

// The sockets of the display cards, which the output "kms" shows pictures on, as veneer doctor
// lists them.

/// A line: what [output] calls it, what is plugged in, its first mode and how many more there are.
[[nodiscard]] std::string text_of(const projector::KmsDisplay& display);
/// Every member by its name, all modes.
[[nodiscard]] nlohmann::ordered_json json_of(const projector::KmsDisplay& display);

}  // namespace veneer::cli
