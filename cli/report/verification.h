// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "simulation/bench.h"

namespace veneer::cli {

struct VerificationOptions {
  std::filesystem::path run;  ///< folder of a run (RecordedRun)
  /// Its sub-folder with frames of the same walk without compensation; none where empty.
  std::string uncompensated;
  std::filesystem::path bench;  ///< bench.toml, the hidden truth
  /// The sample set that the material was fitted to: what the eye should have received.
  std::filesystem::path set;
  /// Looks at every n-th recorded frame. >= 1.
  int every = 1;
  /// Folder to which pictures of each looked-at frame are written; none where empty.
  std::filesystem::path pictures;
  /// The fitted material, taken where `set` is empty: the error of the fit is left out.
  std::filesystem::path material{};
};

/// One frame as the eye received it. "Covered" are the pixels that lie wholly on the object,
/// whether the projector reaches them or not; "within gamut" those of them that the bench's own
/// projector could show with some drive.
struct VerifiedFrame {
  std::uint64_t number = 0;
  Eigen::Vector3d eye_in_world = Eigen::Vector3d::Zero();  ///< true, at the moment of display
  simulation::DifferenceStatistics within_gamut;
  simulation::DifferenceStatistics covered;
  double in_gamut_fraction = 0;
  std::optional<double> uncompensated_mean;  ///< dE00 in gamut of the run without compensation
};

/// All looked-at frames; pixels of all frames weigh alike.
struct RunVerification {
  std::vector<VerifiedFrame> frames;
  simulation::DifferenceStatistics within_gamut;
  simulation::DifferenceStatistics covered;
  simulation::DifferenceStatistics uncompensated;  ///< in gamut; count 0 where there is no such run
  double in_gamut_fraction = 0;
  std::int64_t partial = 0;            ///< pixels left out: on an edge of the object
  std::int64_t unlit = 0;              ///< covered pixels that no projector light reaches
  std::int64_t target_over_white = 0;  ///< covered pixels whose target has L* > 100
};

/// dE00 that the pictures of differences show as brightest.
inline constexpr double kDifferenceScale = 10;

/// Shows the frames of a run on the virtual bench, from the true place of the eye at the moment of
/// display, and compares what is received with what the material would have sent. The object's pose
/// and mesh are known to both sides; the bench refuses a run on another mesh or of another depth.
/// Errors: those of RecordedRun, Scene, Bench, SampleSet and load_material; kInvalidOption (run and
/// bench do not fit); kBadFormat (the eye saw nothing of the object).
[[nodiscard]] Result<RunVerification> verify_run(const VerificationOptions& options,
                                                 Progress& progress);

}  // namespace veneer::cli
