// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "calibration/wizard/devices.h"
#include "calibration/wizard/wizard.h"
#include "simulation/bench.h"
#include "simulation/bench/rig.h"

namespace veneer::cli {

/// A virtual bench with the faces that the wizard knows: devices, hands and a clock of its own.
/// What the wizard asks a person for, the bench does.
class BenchDevices {
 public:
  /// @param talker  borrowed; must outlive this. Is told what the wizard says, and its answer
  /// counts before the bench's hands move, so that a person can be led through a bench too. Errors:
  /// those of Bench::load and VirtualRig::create.
  [[nodiscard]] static Result<std::unique_ptr<BenchDevices>> open(
      const std::filesystem::path& bench_toml, calibration::Operator& talker);

  /// Valid while this lives.
  [[nodiscard]] calibration::Devices devices();
  /// What a person would know without measuring: the distance of the white board, the chequered
  /// board, the object's landmarks.
  void fill(calibration::WizardOptions& options) const;
  [[nodiscard]] const simulation::Bench& bench() const { return *bench_; }

 private:
  class Hands final : public calibration::Operator {
   public:
    Hands(simulation::VirtualRig& rig, calibration::Operator& talker)
        : rig_(rig), talker_(talker) {}
    [[nodiscard]] Result<calibration::Answer> please(const calibration::Request& request) override;
    [[nodiscard]] Result<calibration::Answer> after_failure(std::string_view step,
                                                            const Error& why) override {
      return talker_.after_failure(step, why);
    }
    void say(std::string_view text) override { talker_.say(text); }
    /// Where the stylus is, as the tracker has it; nothing if it touches nothing.
    [[nodiscard]] const std::optional<Eigen::Vector3d>& touched() const { return touched_; }

   private:
    simulation::VirtualRig& rig_;
    calibration::Operator& talker_;
    std::optional<Eigen::Vector3d> touched_;
  };
  class BoardSensor final : public calibration::PoseProbe {
   public:
    explicit BoardSensor(simulation::VirtualRig& rig) : rig_(rig) {}
    [[nodiscard]] Result<tracking::SynchronisedPose> measure() override {
      return rig_.board_sensor();
    }

   private:
    simulation::VirtualRig& rig_;
  };
  class Stylus final : public calibration::PointProbe {
   public:
    Stylus(simulation::VirtualRig& rig, const Hands& hands) : rig_(rig), hands_(hands) {}
    [[nodiscard]] Result<Point> measure() override;

   private:
    simulation::VirtualRig& rig_;
    const Hands& hands_;
  };
  /// The bench's time, which passes while somebody reads, grabs or waits.
  class BenchClock final : public Clock {
   public:
    explicit BenchClock(simulation::VirtualPatchDisplay& display) : display_(display) {}
    [[nodiscard]] Time now() const override { return display_.now(); }
    void sleep_until(Time wake) override {
      if (wake > now()) display_.pass(to_seconds(wake - now()));
    }

   private:
    simulation::VirtualPatchDisplay& display_;
  };

  BenchDevices(std::string name,
               std::unique_ptr<simulation::Bench> bench,
               std::unique_ptr<simulation::VirtualRig> rig,
               calibration::Operator& talker)
      : name_(std::move(name)),
        bench_(std::move(bench)),
        rig_(std::move(rig)),
        hands_(*rig_, talker),
        board_sensor_(*rig_),
        stylus_(*rig_, hands_),
        clock_(rig_->display()) {}

  std::string name_;
  std::unique_ptr<simulation::Bench> bench_;
  std::unique_ptr<simulation::VirtualRig> rig_;
  Hands hands_;
  BoardSensor board_sensor_;
  Stylus stylus_;
  BenchClock clock_;
};

}  // namespace veneer::cli
