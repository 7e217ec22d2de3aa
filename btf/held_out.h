// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/progress.h"
#include "base/result.h"
#include "btf/material.h"
#include "btf/sample_set.h"

// What a fit says of views that it has not seen: those further from the normal than an angle are
// held out of the set, a model is fitted on the others, and measured on both.
namespace veneer::btf {

/// Over texels, views, all lights and channels; both sides cut to [0, 1].
struct ViewsError {
  int views = 0;
  double rmse = 0.0;     ///< linear
  double epsilon = 0.0;  ///< mean absolute difference after the exponent 1/2.2
};

struct HeldOutErrors {
  ViewsError within;  ///< of views up to the angle
  ViewsError beyond;  ///< of views further from the normal
  int texels = 0;     ///< that were compared
};

/// A view this much further than the angle counts as at it: directions lose some last digits as
/// they are written in degrees and read back.
inline constexpr double kViewSlack_rad = 1e-9;

/// Writes the samples of the views up to `most_theta_rad` as a set, in their order and with all
/// lights, and opens it.
/// @param folder  NAME.btfset, replaced whole or not at all
/// Errors: kInvalidOption (an angle outside [0, pi / 2], or one that leaves all views on one side),
/// kIo.
[[nodiscard]] Result<SampleSet> without_views_beyond(const SampleSet& set,
                                                     double most_theta_rad,
                                                     const std::filesystem::path& folder);

/// Holds a material, as it is drawn (Material::radiance), against a set on both sides of an angle.
/// The same figures each time, on any number of threads. Of a polarised set the total is compared.
/// @param set  the whole one: the material may have been fitted on fewer of its views
/// @param most_texels  so many are compared, spread over the sample (spread_texels.h); all where
/// the set has no more
/// Errors: kInvalidOption as above, or no texel is wanted; kBadFormat where the material has
/// another size or a texel map, or where the set or what is drawn holds NaN or infinite values.
[[nodiscard]] Result<HeldOutErrors> held_out_errors(const SampleSet& set,
                                                    const Material& material,
                                                    double most_theta_rad,
                                                    int most_texels,
                                                    Progress& progress);

}  // namespace veneer::btf
