// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calibration/exchange/cgats.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/instruments/shown_patch.h"

namespace veneer::calibration {

/// Drives that are closer than this in every channel are the same patch. It is half a step of 8
/// bits, rounded up, which is also what two decimals of a percentage leave.
inline constexpr double kSameDrive = 2e-3;

/// Gives back the readings of a .ti3, taken earlier or by another program, for the patch that the
/// display shows; the nearest one within kSameDrive. One that was read several times gives its
/// readings in turn. Knows nothing of where it is pointed: every pixel reads the same.
class FileColorimeter final : public Colorimeter {
 public:
  /// @param white_reference  readings of the diffuser.   @param object  of the object, if any.
  /// @param display  borrowed; must outlive this.
  FileColorimeter(MeasuredPatches white_reference,
                  std::optional<MeasuredPatches> object,
                  const WatchedDisplay& display);

  [[nodiscard]] std::string description() const override;
  /// Errors: kNotFound (names the patch that the file lacks; nothing is shown; the lamp is off).
  [[nodiscard]] Result<Xyz> read(Target target, const Eigen::Vector2d& pixel) override;

 private:
  struct Table {
    MeasuredPatches measured;
    std::vector<std::size_t> times_read;  // of the first of equal patches
  };
  std::optional<Table> white_reference_;
  std::optional<Table> object_;
  const WatchedDisplay& display_;
};

}  // namespace veneer::calibration
