// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "capture/development/developer.h"
#include "capture/development/internal_captured_light.h"
#include "capture/polarisation/stokes.h"

// What a developer knows; rig.cc finds it out from a recording, developer.cc develops with it.

namespace veneer::capture {

/// Where an angle of the plan is, modulo half a turn; -1 where it is not.
[[nodiscard]] int index_of_angle(std::span<const double> angles_rad, double wanted_rad);

struct Developer::State {
  const Recording& recording;
  DevelopmentOptions options;
  RigFindings findings;
  std::vector<double> angles_rad;      // of the pictures behind the analyser
  std::optional<StokesSolver> solver;  // where there are more than parallel and cross
  std::vector<PlaneView> white_planes;
  std::vector<Rectifier> on_white, on_sample;  // of each view

  State(const Recording& captured, const DevelopmentOptions& wanted)
      : recording(captured), options(wanted) {}

  [[nodiscard]] const CapturePlan& plan() const { return recording.plan(); }
  [[nodiscard]] Status find_angles();
  [[nodiscard]] Status find_response();
  [[nodiscard]] Status find_noise();
  [[nodiscard]] Status find_planes();
  [[nodiscard]] Status find_lights();
  [[nodiscard]] Status find_leak();

  [[nodiscard]] Result<std::vector<MergedPicture>> light_of(Target target,
                                                            int view,
                                                            int light) const {
    return captured_light(recording, {target, view, light}, findings.response, findings.noise);
  }
  [[nodiscard]] Result<FoundMarks> marks_of(Target target, int view) const;
  [[nodiscard]] Status note_white_range(int view, const Rectifier& rectifier);

  /// Behind one angle of the analyser, in the unit of a sample and halved.
  struct Reading {
    Image<Rgb32f> value, variance;
  };
  struct Texels {
    std::vector<Reading> readings;  // one an angle
    Image<std::uint8_t> masked;
    std::vector<double> saturated;  // of the pixels, one an angle
    double pixels_per_texel = 0;
  };
  [[nodiscard]] Result<Texels> texels_of(Target target, int view, int light) const;
  [[nodiscard]] DevelopedDirection two_pictures(Texels texels) const;
};

}  // namespace veneer::capture
