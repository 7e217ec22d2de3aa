// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/result.h"
#include "capture/development/hdr_merge.h"
#include "capture/development/response.h"
#include "capture/recording.h"

// What a recording holds of one direction, brought to light.

namespace veneer::capture {

/// A bracket and, of each exposure, the picture without the projector's light.
struct CapturedBracket {
  std::vector<Picture> lit, dark;
};
/// @param first  its exposure is counted up from 0.
/// Errors: kNotFound (not captured, and what to do), those of Recording::picture().
[[nodiscard]] Result<CapturedBracket> captured_bracket(const Recording& recording,
                                                       const Shot& first);

/// Merged, one picture for each angle of the analyser; a mosaic's is taken apart into its four.
/// @param shot  its analyser is counted up from 0.
[[nodiscard]] Result<std::vector<MergedPicture>> captured_light(const Recording& recording,
                                                                const Shot& shot,
                                                                const ResponseCurve& response,
                                                                const NoiseModel& noise);

}  // namespace veneer::capture
