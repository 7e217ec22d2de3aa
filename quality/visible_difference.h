// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "base/result.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "calibration/profile.h"
#include "quality/reach.h"

namespace veneer::quality {

/// RGB in the sample's unit (SampleSetInfo), of a texel seen and lit so.
using Reflecting = std::function<Eigen::Vector3d(
    int texel, const btf::Direction& view, const btf::Direction& light)>;

/// How far what one material shows is from what another one does, over all that a scene asks,
/// weighted by how much it is seen.
struct VisibleDifference {
  double de00_mean = 0;  ///< CIEDE2000 of what the surface sends, white = the profile's full drive
  double de00_p95 = 0;
  double de00_max = 0;
  double codes_mean = 0;  ///< of the channel that differs most, in code values, unrounded
  double codes_p95 = 0;
  double codes_max = 0;
  double rmse = 0;  ///< of the RGB of each light, in the sample's unit, over colours

  /// Neither an eye nor the projector's steps tell them apart, wherever one looks.
  [[nodiscard]] bool is_never_seen() const { return de00_max < 0.5 || codes_max < 1.0; }
};

/// Shows what is asked on the projector of a profile: the target in XYZ through compensation in
/// double precision (gamut mapping included) into drives, and by the profile's model into what the
/// surface sends. Codes are not rounded and not dithered, which is what dither means over a few
/// pixels. What is out of the projector's reach sends the same for both.
class VisibleDifferences {
 public:
  /// @param asked  borrowed.
  /// @param set  for the number of texels: Asked::repeats are of it.
  /// Errors: those of the profile's check().
  [[nodiscard]] static Result<VisibleDifferences> make(const calibration::ProjectorProfile& profile,
                                                       std::span<const Asked> asked,
                                                       const btf::SampleSetInfo& set);

  /// Keeps what `truth` shows, for errors_of().
  void set_reference(const Reflecting& truth);
  /// Against the reference. @param material  thread-safe.
  [[nodiscard]] VisibleDifference of(const Reflecting& material) const;

 private:
  struct Shown {
    Eigen::Vector3d codes;  // fractions of a step included
    Xyz sent;
    std::array<Eigen::Vector3d, render::kMaxLights> rgb;
  };
  VisibleDifferences(const calibration::ProjectorProfile& profile,
                     std::span<const Asked> asked,
                     const btf::SampleSetInfo& set);
  [[nodiscard]] std::vector<Shown> show(const Reflecting& material) const;

  calibration::ProjectorProfile profile_;
  std::span<const Asked> asked_;
  int width_;
  int height_;
  std::vector<Shown> reference_;
};

/// Root mean square of material - set at the measured pairs, from the factors alone
/// (Material::reconstruct), in linear light over texels and colours, pairs weighted. Over the pairs
/// that the material keeps: fits to a region let go of those without weight.
/// @param weights  of the set; empty: all alike.
/// Errors: kBadFormat where the material has another size or directions that are not the set's.
[[nodiscard]] Result<double> weighted_rmse(const btf::SampleSet& set,
                                           const btf::Material& material,
                                           const btf::PairWeights& weights);

}  // namespace veneer::quality
