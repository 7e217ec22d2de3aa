// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/hands.h"
#include "capture/polariser.h"

namespace veneer::capture {

/// A person turns it. Reads no keys. @param hands  borrowed; must outlive the polariser.
[[nodiscard]] Result<std::unique_ptr<Polariser>> open_hand_polariser(TomlReader& config,
                                                                     Hands& hands);

}  // namespace veneer::capture
