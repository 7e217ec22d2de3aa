// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <functional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/patch_display.h"
#include "calibration/wizard/operator.h"
#include "capture/camera.h"
#include "projector/control.h"
#include "tracking/synchronised.h"

namespace veneer::calibration {

/// Tells where something stands that the tracker follows, while it stands still.
class PoseProbe {
 public:
  virtual ~PoseProbe() = default;
  /// world_from_sensor. Errors: kTimeout (not seen, or not still; try again), kDisconnected.
  [[nodiscard]] virtual Result<tracking::SynchronisedPose> measure() = 0;
};

/// A point that a person touches with a tracked stylus.
class PointProbe {
 public:
  struct Point {
    Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();  ///< metres
    double deviation_m = 0;                                ///< of a coordinate
  };
  virtual ~PointProbe() = default;
  /// The point that is being touched. Errors: kTimeout (try again), kDisconnected.
  [[nodiscard]] virtual Result<Point> measure() = 0;
};

/// What a calibration works with, the same for real devices and for a virtual bench. All borrowed;
/// must outlive the wizard. What may be null is named; steps that need it are skipped then, or say
/// what else would do.
struct Devices {
  PatchDisplay* display = nullptr;
  Colorimeter* colorimeter = nullptr;
  Operator* hands = nullptr;
  Clock* clock = nullptr;
  capture::Camera* camera = nullptr;               ///< null: geometry comes from elsewhere
  PoseProbe* board_sensor = nullptr;               ///< null: nothing tracks the board
  PointProbe* stylus = nullptr;                    ///< null: nothing can be touched
  projector::ProjectorControl* control = nullptr;  ///< null: the projector cannot be asked
  /// Called when a step begins, and after one failed: what was moved meanwhile is not where it was.
  std::function<void()> begin_step;
  /// Whether the instrument gets to any spot by itself; else a person points it, and is asked for
  /// as few spots as will do.
  bool aims_itself = false;
  int width = 0;  ///< of the projector's raster, pixels
  int height = 0;
  int bits = 8;  ///< of a drive code
  /// What is calibrated with what, for the record and to tell sessions apart.
  std::string projector;
  std::string instrument;
};

}  // namespace veneer::calibration
