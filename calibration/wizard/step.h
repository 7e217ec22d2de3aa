// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/journal.h"
#include "base/progress.h"
#include "base/result.h"
#include "calibration/geometry/board.h"
#include "calibration/geometry/bundle_adjustment.h"
#include "calibration/geometry/registration.h"
#include "calibration/geometry/tied_registration.h"
#include "calibration/radiometry.h"
#include "calibration/verification.h"
#include "calibration/wizard/devices.h"
#include "calibration/wizard/diagnosis.h"
#include "calibration/wizard/recorded_devices.h"

namespace veneer::calibration {

/// A place of the object that a person can find and touch.
struct Landmark {
  std::string name;  ///< "tip of the nose"
  Eigen::Vector3d in_object = Eigen::Vector3d::Zero();
};

struct WizardOptions {
  std::filesystem::path profile;  ///< the folder to write
  std::filesystem::path session;  ///< the folder of what was found out so far
  bool restart = false;           ///< forget what an earlier run of the session found
  /// Steps that are left out.
  std::set<std::string> skip;
  /// A geometry that is taken over where there is no camera, or `geometry` is skipped.
  std::optional<ProjectorGeometry> known_geometry;

  RadiometryOptions radiometry;
  geometry::Board board;  ///< what the camera looks at; square in metres
  int board_poses = 8;    ///< that are asked for. 4 to 40
  /// Cross-hairs that are tried over the picture, each way; those that miss the object are skipped.
  int cross_hairs = 5;              ///< 0 to 20
  std::vector<Landmark> landmarks;  ///< of the object; none: it is not registered

  /// The lamp counts as warm when white changes by less than this a minute.
  double settled_per_minute = 5e-4;
  double warm_up_window_s = 60;     ///< over which that is seen
  double warm_up_interval_s = 5;    ///< between two readings
  double most_warm_up_s = 45 * 60;  ///< after which it goes on with a warning
  /// A DLP projector makes a picture of several in a frame: exposures are whole numbers of it.
  double frame_s = 1.0 / 60;
  int verification_patches = 64;  ///< 43 to 1000
  int verification_repeats = 8;   ///< readings of each that are averaged. 1 to 100

  [[nodiscard]] Status check() const;
};

/// A corner of a board: where the projector was seen to light it and where the fit says it does.
struct Reprojection {
  int view = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector2d error = Eigen::Vector2d::Zero();
};

/// What the steps found, each taking what those before it left.
struct WizardResults {
  WarmUp warm_up;
  Repeatability white;  ///< of the colorimeter, on white
  Repeatability ambient;
  GreyRamp ramp;
  std::vector<geometry::BoardView> views;
  std::vector<tracking::SynchronisedPose> sensors;  ///< one a view, or none
  std::optional<geometry::GeometryCalibration> geometry;
  std::vector<Reprojection> reprojections;
  std::optional<geometry::BoardRegistration> registration;  ///< where a tracker follows the board
  std::optional<geometry::TiedRegistration> tied;           ///< refined over the pixels
  std::optional<ProjectorGeometry> projector;
  std::optional<MeasuredProfile> measured;
  std::optional<geometry::PointRegistration> object;
  std::vector<geometry::PixelTouch> cross_hairs;  ///< that were touched
  std::optional<ProfileVerification> verification;
  /// As it was last asked; empty where it cannot be.
  projector::ControlRecord projector_record;
};

/// How a step went, for people and for the report.
struct StepReport {
  std::string name;
  std::string title;
  bool skipped = false;
  std::string summary;  ///< a line
  std::vector<Finding> findings;
};

/// What a step works with.
struct StepContext {
  const WizardOptions& options;
  Devices& devices;
  Journal& journal;
  RecordedDevices& recorded;  ///< display and colorimeter, see there
  Progress& progress;
  WizardResults& results;
  StepReport& report;
  const std::vector<StepReport>& reports;  ///< of the steps so far

  /// Asks for something; what the journal says was done already is not asked again.
  [[nodiscard]] Result<Answer> please(Task task, int index, std::string text) {
    return devices.hands->please({task, index, std::move(text)});
  }
  void find(Finding finding) { report.findings.push_back(std::move(finding)); }
};

/// One step of the wizard.
struct Step {
  std::string_view name;   ///< as --skip takes it
  std::string_view title;  ///< a heading
  std::string_view about;  ///< what happens and what it is good for, in a sentence or two
  /// kDone goes on. An error is said, and the person asked what to do. It may be run again at any
  /// time, and must then find what the journal has.
  Result<Answer> (*run)(StepContext& context);
};

// The steps, in their order; each is in a file of its own in steps/.
/// Needs Devices::control; left out where there is none.
[[nodiscard]] Result<Answer> look_at_projector(StepContext& context);
[[nodiscard]] Result<Answer> check_picture(StepContext& context);
[[nodiscard]] Result<Answer> warm_up(StepContext& context);
[[nodiscard]] Result<Answer> look_at_room(StepContext& context);
[[nodiscard]] Result<Answer> find_geometry(StepContext& context);
[[nodiscard]] Result<Answer> register_object(StepContext& context);
[[nodiscard]] Result<Answer> measure_light(StepContext& context);
[[nodiscard]] Result<Answer> verify(StepContext& context);
[[nodiscard]] Result<Answer> publish(StepContext& context);

}  // namespace veneer::calibration
