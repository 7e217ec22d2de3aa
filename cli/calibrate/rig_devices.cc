// SPDX-License-Identifier: Apache-2.0
#include "cli/calibrate/rig_devices.h"

#include <utility>

#include "base/toml_reader.h"
#include "capture/cameras/cameras.h"
#include "cli/calibrate/display_picker.h"
#include "projector/control_watch.h"
#include "projector/controls.h"
#include "projector/outputs.h"
#include "projector/outputs/window/window_output.h"
#include "tracking/drivers.h"

namespace veneer::cli {

using calibration::Answer;

Result<std::unique_ptr<RigDevices>> RigDevices::open(const std::filesystem::path& rig_toml,
                                                     calibration::Operator& hands,
                                                     calibration::WizardOptions& options) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(rig_toml));
  std::unique_ptr<RigDevices> rig(new RigDevices(hands));
  rig->projector_ = rig_toml.stem().string();
  toml.read("projector", rig->projector_);
  toml.require("reference_distance_m", options.radiometry.reference_distance_m);
  toml.read("bits", rig->bits_);
  Eigen::Vector2d raster = Eigen::Vector2d::Zero();
  toml.read("raster", raster);
  rig->width_ = static_cast<int>(raster.x());
  rig->height_ = static_cast<int>(raster.y());

  TomlReader wizard = toml.table("wizard");
  wizard.read("board_poses", options.board_poses);
  wizard.read("ramp_levels", options.radiometry.levels);
  wizard.read("repeats", options.radiometry.repeats);
  wizard.read("settled_per_minute", options.settled_per_minute);
  wizard.read("most_warm_up_s", options.most_warm_up_s);
  wizard.read("frame_s", options.frame_s);
  wizard.read("verification_patches", options.verification_patches);
  wizard.read("verification_repeats", options.verification_repeats);
  for (TomlReader& table : toml.tables("landmark")) {
    calibration::Landmark landmark;
    table.require("name", landmark.name);
    table.require("position_m", landmark.in_object);
    options.landmarks.push_back(std::move(landmark));
  }
  VENEER_TRY(rig->open_control(toml));
  VENEER_TRY(rig->open_output(toml));
  VENEER_TRY(rig->open_camera(toml));
  VENEER_TRY(rig->open_probes(toml, options));
  // Last: it has the whole file checked, and what was not asked for yet would be unknown to it.
  VENEER_TRY(rig->open_instrument(toml));
  VENEER_TRY(toml.finish());
  return rig;
}

Status RigDevices::open_control(TomlReader& toml) {
  TomlReader table = toml.table("control");
  if (!table.contains("driver")) return {};
  VENEER_ASSIGN(control_, projector::open_control(table, clock_));
  // The daemon's key, so that both can have the same table.
  static_cast<void>(projector::ControlWatchOptions::read(table));
  return {};
}

Status RigDevices::open_output(TomlReader& toml) {
  TomlReader table = toml.table("output");
  std::string driver;
  table.read("driver", driver);
  if (driver == "window") {
    projector::WindowOutputOptions options;
    table.read("fullscreen", options.fullscreen);
    if (table.contains("display")) {
      table.read("display", options.display);
    } else {
      VENEER_ASSIGN(options.display, pick_display());
    }
    VENEER_ASSIGN(std::unique_ptr<projector::WindowOutput> window,
                  projector::WindowOutput::open(options));
    if (width_ == 0 && height_ == 0) {
      width_ = window->display().width;
      height_ = window->display().height;
    }
    output_ = std::move(window);
  } else {
    VENEER_ASSIGN(output_, projector::open_output(table));
  }
  if (width_ < 1 || height_ < 1 || width_ > 16384 || height_ > 16384 || bits_ < 4 || bits_ > 16)
    return fail(Errc::kInvalidOption,
                "opening the rig: the raster is {} x {} pixels of {} bits; say raster = [width, "
                "height] and bits",
                width_,
                height_,
                bits_);
  display_.emplace(
      *output_, hands_, clock_, calibration::OutputPatchDisplay::Options{width_, height_, bits_});
  watched_.emplace(*display_, bits_);
  return {};
}

Status RigDevices::open_camera(TomlReader& toml) {
  TomlReader table = toml.table("camera");
  if (!table.contains("driver")) return {};
  VENEER_ASSIGN(camera_, capture::open_camera(table));
  return {};
}

Status RigDevices::open_instrument(TomlReader& toml) {
  const auto ask = [this](const std::string& what_to_do) -> Status {
    VENEER_ASSIGN(const Answer answer,
                  hands_.please({calibration::Task::kAimAtBoard, 0, what_to_do}));
    if (answer != Answer::kDone)
      return fail(Errc::kCancelled, "what the instrument needs was refused");
    return {};
  };
  TomlReader table = toml.table("instrument");
  VENEER_ASSIGN(instrument_,
                calibration::open_instrument(table, {clock_, ask, &*watched_, camera_.get()}));
  aimed_.emplace(*instrument_, hands_);
  return {};
}

Status RigDevices::open_probes(TomlReader& toml, calibration::WizardOptions& options) {
  int board_body = -1;
  double square_mm = 0;
  TomlReader board = toml.table("board");
  board.read("columns", options.board.columns);
  board.read("rows", options.board.rows);
  board.read("square_mm", square_mm);
  board.read("sensor_body", board_body);
  options.board.square = 1e-3 * square_mm;
  int stylus_body = -1;
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  TomlReader stylus = toml.table("stylus");
  stylus.read("body", stylus_body);
  stylus.read("tip_m", tip);
  TomlReader table = toml.table("tracker");
  if (table.contains("driver")) {
    VENEER_ASSIGN(tracker_, tracking::open_tracker(table, clock_));
  } else if (board_body >= 0 || stylus_body >= 0) {
    return fail(Errc::kInvalidOption,
                "opening the rig: the board's or the stylus's body is named, but no [tracker]");
  }
  if (board_body >= 0) board_sensor_.emplace(*tracker_, board_body, calibration::StillOptions{});
  if (stylus_body >= 0) stylus_.emplace(*tracker_, stylus_body, tip, calibration::StillOptions{});
  return {};
}

calibration::Devices RigDevices::devices() {
  calibration::Devices devices;
  devices.display = &*watched_;
  devices.colorimeter = &*aimed_;
  devices.hands = &hands_;
  devices.clock = &clock_;
  devices.camera = camera_.get();
  devices.control = control_.get();
  devices.begin_step = [this] { aimed_->forget_aim(); };
  devices.board_sensor = board_sensor_ ? &*board_sensor_ : nullptr;
  devices.stylus = stylus_ ? &*stylus_ : nullptr;
  devices.width = width_;
  devices.height = height_;
  devices.bits = bits_;
  devices.projector = projector_;
  devices.instrument = instrument_->description();
  return devices;
}

}  // namespace veneer::cli
