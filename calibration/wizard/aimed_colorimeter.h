// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <utility>

#include "calibration/instruments/colorimeter.h"
#include "calibration/wizard/operator.h"

namespace veneer::calibration {

/// A colorimeter that a person points: whenever another spot is to be read, the operator is asked.
class AimedColorimeter final : public Colorimeter {
 public:
  /// Borrowed; must outlive this.
  AimedColorimeter(Colorimeter& instrument, Operator& hands)
      : instrument_(instrument), hands_(hands) {}
  [[nodiscard]] std::string description() const override { return instrument_.description(); }
  /// Asks anew for the next reading: something may have been moved.
  void forget_aim() { aim_.reset(); }
  /// Errors: also kCancelled (it was not pointed there).
  [[nodiscard]] Result<Xyz> read(Target target, const Eigen::Vector2d& pixel) override;

 private:
  Colorimeter& instrument_;
  Operator& hands_;
  std::optional<std::pair<Target, Eigen::Vector2d>> aim_;
};

}  // namespace veneer::calibration
