// SPDX-License-Identifier: Apache-2.0
#include "cli/calibrate/bench_devices.h"

#include <algorithm>
#include <utility>

namespace veneer::cli {

using calibration::Answer;
using calibration::Task;

Result<std::unique_ptr<BenchDevices>> BenchDevices::open(const std::filesystem::path& bench_toml,
                                                         calibration::Operator& talker) {
  VENEER_ASSIGN(std::unique_ptr<simulation::Bench> bench, simulation::Bench::load(bench_toml));
  VENEER_ASSIGN(std::unique_ptr<simulation::VirtualRig> rig,
                simulation::VirtualRig::create(*bench));
  return std::unique_ptr<BenchDevices>(
      new BenchDevices(bench_toml.stem().string(), std::move(bench), std::move(rig), talker));
}

calibration::Devices BenchDevices::devices() {
  const simulation::ProjectorTruth& projector = bench_->truth().projector;
  calibration::Devices devices;
  devices.display = &rig_->display();
  devices.colorimeter = &rig_->colorimeter();
  devices.hands = &hands_;
  devices.clock = &clock_;
  devices.camera = &rig_->camera();
  devices.board_sensor = &board_sensor_;
  devices.stylus = &stylus_;
  devices.aims_itself = true;
  devices.width = projector.width;
  devices.height = projector.height;
  devices.bits = projector.bits;
  devices.projector = "the virtual bench " + name_;
  devices.instrument = rig_->colorimeter().description();
  return devices;
}

void BenchDevices::fill(calibration::WizardOptions& options) const {
  options.radiometry.reference_distance_m = bench_->truth().projector.reference_distance_m;
  options.board = {rig_->board_columns(), rig_->board_rows(), rig_->board_square_m()};
  options.board_poses = std::min(options.board_poses, rig_->board_poses());
  for (const simulation::Landmark& landmark : rig_->landmarks())
    options.landmarks.push_back({landmark.name, landmark.in_object});
}

Result<Answer> BenchDevices::Hands::please(const calibration::Request& request) {
  VENEER_ASSIGN(const Answer answer, talker_.please(request));
  if (answer != Answer::kDone) return answer;
  switch (request.task) {
    case Task::kPlaceBoard:
      VENEER_TRY(rig_.place_board(request.index));
      break;
    case Task::kRemoveBoard:
      rig_.remove_board();
      break;
    case Task::kTouch: {
      const auto& landmarks = rig_.landmarks();
      const auto index = static_cast<std::size_t>(request.index);
      touched_.reset();
      if (index < landmarks.size()) touched_ = rig_.touch(landmarks[index].in_object);
      break;
    }
    case Task::kTouchSpot: {
      const Result<Eigen::Vector3d> spot = rig_.touch_spot(request.pixel);
      if (!spot) return Answer::kSkip;  // it falls past the object
      touched_ = *spot;
      break;
    }
    // Display and colorimeter of a bench are told by themselves.
    case Task::kAimAtBoard:
    case Task::kAimAtObject:
    case Task::kCoverLens:
    case Task::kUncoverLens:
    case Task::kSeeToProjector:
      break;
  }
  return answer;
}

Result<calibration::PointProbe::Point> BenchDevices::Stylus::measure() {
  if (!hands_.touched()) return fail(Errc::kTimeout, "the stylus touches nothing");
  return Point{*hands_.touched(), rig_.touch_deviation_m()};
}

}  // namespace veneer::cli
