// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "calibration/profile.h"
#include "render/renderer.h"

namespace veneer::stability {

/// A profile and options for which compensation is taken to its ends.
struct CompensationSubject {
  const char* name;  ///< of the test
  int bits;
  /// Of render::example_profile().
  void (*change)(calibration::ProjectorProfile&, render::RendererOptions&);
};

[[nodiscard]] std::span<const CompensationSubject> compensation_subjects();

}  // namespace veneer::stability
