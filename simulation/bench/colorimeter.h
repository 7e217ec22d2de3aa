// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "base/clock.h"
#include "base/image.h"
#include "base/random.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/patch_display.h"
#include "calibration/profile.h"
#include "simulation/bench.h"

namespace veneer::simulation {

/// The bench's projector as something that shows patches, and the bench's time: it passes only
/// while somebody reads, grabs or waits. The lamp is switched on when it begins.
class VirtualPatchDisplay final : public calibration::PatchDisplay {
 public:
  /// @param bench  borrowed; must outlive the display.
  explicit VirtualPatchDisplay(const Bench& bench) : bench_(bench) {}
  /// Errors: kInvalidOption (a code over 2^bits - 1).
  [[nodiscard]] Status show(const Rgb16& code, bool lit = true) override;
  /// Errors: kInvalidOption (a picture of another size than the raster, a code over 2^bits - 1).
  [[nodiscard]] Status show_picture(ImageView<const Rgb16> codes) override;
  [[nodiscard]] const std::array<std::uint16_t, 3>& code() const { return code_; }
  [[nodiscard]] bool lit() const { return lit_; }
  /// Empty while a patch is shown.
  [[nodiscard]] const Image<Rgb16>& picture() const& { return picture_; }
  const Image<Rgb16>& picture() const&& = delete;
  /// Counts what was shown: another number says that it may have changed.
  [[nodiscard]] std::uint64_t shown() const { return shown_; }

  [[nodiscard]] Time now() const { return clock_.now(); }
  /// @param seconds  >= 0.
  void pass(double seconds) { clock_.sleep_until(clock_.now() + from_seconds(seconds)); }
  /// The lamp's light now, in parts of its settled light; 0 while it is off.
  [[nodiscard]] double lamp() const;

 private:
  const Bench& bench_;
  VirtualClock clock_;
  std::uint64_t shown_ = 0;
  std::array<std::uint16_t, 3> code_{};
  bool lit_ = false;
  Image<Rgb16> picture_;  // empty while a patch is shown
};

struct VirtualColorimeterOptions {
  /// Standard deviation of each of X, Y, Z, in parts of it.
  double relative_noise = 0.001;
  /// Standard deviation of each of X, Y, Z in the dark, cd/m^2.
  double dark_noise_nits = 0.002;
  std::uint64_t seed = 1;
  /// Of its gain, in parts.
  double drift_per_hour = 0;
  /// What it reads of the light L is (I + matrix_error) L, but for noise and drift.
  Eigen::Matrix3d matrix_error = Eigen::Matrix3d::Zero();
};

/// The instrument that stands in the bench's truth.
[[nodiscard]] VirtualColorimeterOptions options_from(const InstrumentTruth& truth);

/// A colorimeter on the bench that sees what the display shows. The same readings for the same
/// seed. Of a picture it reads the pixel's
/// own code, as if that filled the spot. A reading passes a second of the bench's time.
class VirtualColorimeter final : public calibration::Colorimeter {
 public:
  /// @param bench, display  borrowed; must outlive the colorimeter.
  VirtualColorimeter(const Bench& bench,
                     VirtualPatchDisplay& display,
                     const VirtualColorimeterOptions& options)
      : bench_(bench), display_(display), options_(options), random_(options.seed) {}
  [[nodiscard]] std::string description() const override { return "the bench's colorimeter"; }
  /// Errors: kInvalidOption (a pixel off the raster).
  [[nodiscard]] Result<Xyz> read(calibration::Target target, const Eigen::Vector2d& pixel) override;

 private:
  const Bench& bench_;
  VirtualPatchDisplay& display_;
  VirtualColorimeterOptions options_;
  Pcg32 random_;
};

/// What a perfect geometric calibration of the bench's projector would find.
[[nodiscard]] calibration::ProjectorGeometry true_geometry(const Bench& bench);

}  // namespace veneer::simulation
