// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "base/result.h"
#include "capture/camera.h"
#include "capture/plan.h"

namespace veneer::capture {

/// Part of the pixels that may be saturated in the shortest exposure: single hot ones are no
/// reason to expose everything else too little.
inline constexpr double kAllowedSaturation = 1e-4;
/// Of full scale: a tenth of the cross picture is to be above it in the longest exposure.
inline constexpr double kDimEnough = 0.15;

/// One picture of that exposure in seconds.
using Expose = std::function<Result<CameraFrame>(double seconds)>;

/// Exposures that the camera can do and the plan allows, in seconds.
struct ExposureChoice {
  ExposureRange range;
  double multiple_of_s = 0;  ///< see ExposurePlan

  /// The nearest that is allowed, not above `seconds` where there is one.
  [[nodiscard]] double at_most(double seconds) const;
  /// Errors: kInvalidOption (no multiple is in the camera's range, or that is empty).
  [[nodiscard]] Status check() const;
};

struct ProbedExposure {
  double exposure_s = 0;
  bool reached = true;  ///< what was looked for; else the end of the range
};

/// The longest exposure with which nothing that matters is saturated, found from `start_s` by
/// looking at pictures. Errors: those of `expose`.
[[nodiscard]] Result<ProbedExposure> longest_unsaturated(const Expose& expose,
                                                         const ExposureChoice& choice,
                                                         double start_s);
/// The shortest in which the dim tenth of the picture is exposed enough.
/// @param most_s  is not gone beyond. Errors: those of `expose`.
[[nodiscard]] Result<ProbedExposure> shortest_dim_enough(const Expose& expose,
                                                         const ExposureChoice& choice,
                                                         double start_s,
                                                         double most_s);
/// From the shortest to the first that reaches `longest_s`, shortest first, each about plan.step
/// times the one before; at most plan.most.
[[nodiscard]] std::vector<double> bracket_between(double shortest_s,
                                                  double longest_s,
                                                  const ExposurePlan& plan,
                                                  const ExposureChoice& choice);

}  // namespace veneer::capture
