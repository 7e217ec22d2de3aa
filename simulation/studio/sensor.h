// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "base/image.h"
#include "simulation/studio/poisson_deviates.h"
#include "simulation/studio/truth.h"

namespace veneer::simulation::studio {

/// From light to counts. A colour camera has three chips: every pixel has all three channels, each
/// with noise and patterns of its own. A mosaic is on one chip, whose counts stand in all three.
class StudioSensor {
 public:
  /// Light of 1 fills the well in this time.
  static constexpr double kFill_s = 0.1;
  /// Part of the full well at which the converter is at its full scale (less its offset): a little
  /// before the well is, as cameras are made, so that all saturated pixels say so.
  static constexpr double kConverterReach = 0.95;

  /// @param truth  valid.
  explicit StudioSensor(const StudioTruth& truth);

  [[nodiscard]] std::uint16_t full_scale() const;
  /// Electrons that a pixel of gain 1 gathers, dark current included.
  [[nodiscard]] double electrons(double light, double exposure_s) const;
  /// A picture. The same for the same number.
  /// @param light  of every pixel, at least 0.
  /// @param gain  of the amplifier, a factor.
  [[nodiscard]] Image<Rgb16> expose(const Image<Rgb32f>& light,
                                    double exposure_s,
                                    double gain,
                                    std::uint64_t number) const;

 private:
  StudioTruth truth_;
  PoissonDeviates poisson_;
  std::vector<float> deviates_;  // a table of normal ones
  std::vector<float> gains_;     // of pixels' channels: electrons over those of a perfect pixel
  std::vector<float> offsets_;   // counts
};

}  // namespace veneer::simulation::studio
