// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// The dichromatic split of a polarised sample set, each term a scalar with Eigen-BRDFs of its own,
/// clustered together and drawn as PackedLpca. `components` is "shading+specular".
///
/// D_ref(x) is the diffuse part at the reference pair, the view and the light nearest the normal.
/// The specular part is p(x) * c with one colour c for the material, the best for all specular
/// samples. Two forms (FitOptions::form):
/// - "ratio" (default) draws s * D_ref + p * c with s = <D, D_ref> / <D_ref, D_ref>. Texels whose
///   D_ref is under the noise have no ratio: their diffuse part is drawn as 0, and metadata
///   "masked_texels" says how many they are.
/// - "subtractive", as the authors have it, draws D_ref - C * d + p * c, where C = D_ref - D is
/// what
///   the shadow takes away and d its one colour. A light beyond the data fades the sum of all
///   three.
///
/// Source: Obara, Tsumura, Nakaguchi, Miyake 2006, "Fast BTF rendering for appearance-based display
/// using dichromatic reflection model", sections 3 and 5. Polarised separation: I_par - I_cross is
/// specular, I_cross diffuse.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_dichromatic_lpca(const SampleSet& set,
                                                                     const FitOptions& options,
                                                                     Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_dichromatic_lpca(const SafetensorsFile& file);

}  // namespace veneer::btf
