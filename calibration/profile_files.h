// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "calibration/colour/colour_model.h"
#include "calibration/drive_correction.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// The drive, in [0, 1]^3, that makes a perfect diffuser at the reference send `xyz` (cd/m^2, black
/// in it). What is out of reach is cut to the cube; see render/compensation.h for a mapping that
/// keeps hue.
class ProfileInverse {
 public:
  /// @param profile  must pass check(); borrowed, must outlive this.
  explicit ProfileInverse(const ProjectorProfile& profile);
  [[nodiscard]] Eigen::Vector3d operator()(const Xyz& xyz) const;

 private:
  const ProjectorProfile* profile_;
  DriveCorrection correction_;
  Eigen::Matrix3d linear_from_xyz_;
};

/// What other programs read of a profile, written into a folder:
///
/// - `projector.icc`: for colour management (with a grid where the channels act on each other);
/// - `srgb_to_drive.cube`: a look-up table that makes the projector show sRGB, its white scaled to
///   the brightest that all three channels reach, out-of-gamut colours cut;
/// - `projector.yaml`: the pinhole and its pose for cv::FileStorage;
/// - `gl_projection.json`: the same as matrices for GL programs;
/// - `readings.ti3`: the patches that were read, for ArgyllCMS (none where there are none).
///
/// Errors: kBadFormat, kIo.
[[nodiscard]] Status write_profile_files(const ProjectorProfile& profile,
                                         std::span<const PatchReading> readings,
                                         const std::string& instrument,
                                         const std::filesystem::path& folder);

}  // namespace veneer::calibration
