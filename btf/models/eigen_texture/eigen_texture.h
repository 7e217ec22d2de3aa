// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// Eigen-textures: for every measured view, `components` RGB images whose weighted sum is the
/// picture under any measured light; between measured directions, the three nearest views and the
/// three nearest lights are mixed. The weights depend on view and light alone, the images on texel
/// and view.
///
/// The images are the projections of a view's pictures on the eigenvectors of their lights x lights
/// Gram matrix over all texels and channels, uncentred: the best approximation of that rank.
/// Exact where there are no more lights than components. Samples are read in blocks of texels,
/// never held all at once.
///
/// `precision` is that of the images. "8bit" (the default, as published: 3 bytes a texel, view and
/// component) rounds each image to steps of its own range; which code stands for 0 is chosen for
/// each component, in common to all views, for the smallest error, so that 0 stays 0. "float16"
/// rounds to 11 binary digits. What `components` may be, 1 to 16, and the size of a set are limited
/// by the layers of a texture array and by its bytes.
///
/// Sources: Sattler, Sarlette, Klein 2003, "Efficient and Realistic Visualization of Cloth"; Meseth
/// et al. 2003, "BTF Rendering for Virtual Environments", section 3.4, equation 6.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_eigen_texture(const SampleSet& set,
                                                                  const FitOptions& options,
                                                                  Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_eigen_texture(const SafetensorsFile& file);

}  // namespace veneer::btf
