// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "calibration/instruments/instruments.h"
#include "calibration/instruments/shown_patch.h"
#include "calibration/wizard/aimed_colorimeter.h"
#include "calibration/wizard/devices.h"
#include "calibration/wizard/output_display.h"
#include "calibration/wizard/tracked_probes.h"
#include "calibration/wizard/wizard.h"
#include "capture/camera.h"
#include "projector/control.h"
#include "projector/output.h"
#include "tracking/tracker.h"

namespace veneer::cli {

/// The devices of a real rig, as rig.toml names them:
///
///     projector = "LightCrafter 4500"       # for the record
///     raster = [1280, 800]                  # not needed for a window, which has its display's
///     reference_distance_m = 1.2            # from the lens to the white board
///     [output]                              # as for veneerd; without `display` one is picked
///     driver = "window"
///     [instrument]
///     driver = "spotread"
///     [camera]                              # optional: finds the geometry; docs/howto/camera.md
///     driver = "aravis"
///     [tracker]                             # optional, as for veneerd
///     [control]                             # optional: how the projector is set is kept with the
///     driver = "pjlink"                     # profile; docs/howto/projector.md
///     [board]                               # the chequered board for the camera
///     columns = 9
///     rows = 7
///     square_mm = 25
///     sensor_body = 3                       # optional
///     [stylus]                              # optional
///     body = 2
///     tip_m = [0, 0, 0.12]
///     [[landmark]]                          # of the object
///     name = "tip of the nose"
///     position_m = [0.01, 0.02, 0.10]
///     [wizard]                              # as WizardOptions
class RigDevices {
 public:
  /// Opens all of them and takes over what the file says into `options`.
  /// @param hands  borrowed; must outlive this.
  /// Errors: kInvalidOption (the file), those of the devices.
  [[nodiscard]] static Result<std::unique_ptr<RigDevices>> open(
      const std::filesystem::path& rig_toml,
      calibration::Operator& hands,
      calibration::WizardOptions& options);
  /// Valid while this lives.
  [[nodiscard]] calibration::Devices devices();

 private:
  explicit RigDevices(calibration::Operator& hands) : hands_(hands) {}
  [[nodiscard]] Status open_output(TomlReader& toml);
  [[nodiscard]] Status open_camera(TomlReader& toml);
  [[nodiscard]] Status open_control(TomlReader& toml);
  [[nodiscard]] Status open_instrument(TomlReader& toml);
  [[nodiscard]] Status open_probes(TomlReader& toml, calibration::WizardOptions& options);

  calibration::Operator& hands_;
  SteadyClock clock_;
  std::string projector_;
  int width_ = 0;
  int height_ = 0;
  int bits_ = 8;
  std::unique_ptr<projector::Output> output_;
  std::optional<calibration::OutputPatchDisplay> display_;
  std::optional<calibration::WatchedDisplay> watched_;
  std::unique_ptr<projector::ProjectorControl> control_;  // null: the projector cannot be asked
  std::unique_ptr<capture::Camera> camera_;               // null: geometry comes from elsewhere
  std::unique_ptr<calibration::Colorimeter> instrument_;
  std::optional<calibration::AimedColorimeter> aimed_;
  std::unique_ptr<tracking::Tracker> tracker_;
  std::optional<calibration::TrackedPoseProbe> board_sensor_;
  std::optional<calibration::TrackedPointProbe> stylus_;
};

}  // namespace veneer::cli
