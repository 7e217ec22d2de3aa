// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "base/toml_reader.h"
#include "projector/output.h"

namespace veneer::projector {

/// Takes every frame and does nothing with it, not even wants its pixels: for timing the rest.
class NullOutput final : public Output {
 public:
  /// Has no keys; never fails.
  [[nodiscard]] static Result<std::unique_ptr<NullOutput>> open(TomlReader& config);
  [[nodiscard]] std::string description() const override { return "null output"; }
  [[nodiscard]] bool wants_pixels(std::uint64_t /*frame_number*/) const override { return false; }
  [[nodiscard]] Status present(const Frame& /*frame*/) override { return {}; }
};

}  // namespace veneer::projector
