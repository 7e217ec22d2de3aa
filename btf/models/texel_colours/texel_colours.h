// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// Two learned colours for every texel: the best rank-2 colour basis of its own 3 x (views *
/// lights) matrix, and two scalar functions in that basis, clustered together and drawn as
/// PackedLpca.
///
/// The colours are orthonormal, so squared errors of the scalars are squared errors in RGB. The
/// first is the one with the larger energy and has a non-negative mean. `components` is "n1+n2".
/// `mip_levels` adds means over 2 x 2, 4 x 4, ... texels with colours and weights of their own, in
/// clusters that all levels share (Schneider 2004 proposes mip levels as future work).
/// The idea is the dichromatic split of Obara et al. 2006 with colours learned instead of body and
/// light colour, so that it needs no polarisers and holds for any material of two colours a texel.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_texel_colours(const SampleSet& set,
                                                                  const FitOptions& options,
                                                                  Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_texel_colours(const SafetensorsFile& file);

}  // namespace veneer::btf
