// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// The dichromatic split of a polarised sample set, each term a scalar with Eigen-BRDFs of its own,
/// clustered together and drawn as PackedLpca. `components` is "shading+specular".
///
/// The specular part is p(x) * c with one colour c for the material, the best for all specular
/// samples. D_ref(x) is the diffuse part at the reference pair, the view and the light nearest the
/// normal. Three forms (FitOptions::form):
/// - "learned" (default) draws s * b + p * c with b(x) the one colour that is best for all diffuse
///   samples of a texel and s = <D, b>: never worse than a ratio in the squares of the diffuse
///   part.
/// - "ratio" draws s * D_ref + p * c with s = <D, D_ref> / <D_ref, D_ref>.
/// - "subtractive", as the authors have it, draws D_ref - C * d + p * c, where C = D_ref - D is
/// what
///   the shadow takes away and d its one colour. A light beyond the data fades the sum of all
///   three.
/// The specular scalar p may be kept over the isotropic half angle (half_angle.h) in place of view
/// and light (FitOptions::specular): a volume of its own, one fetch for four components instead of
/// two, for materials whose gloss has the texel's own normal and no grain. "measured" fits both and
/// keeps it where its error of the specular term is at most 5 % above the product's. Not with form
/// "subtractive".
///
/// The two terms may have clusters of their own (FitOptions::clustering), as many each: a texel
/// then has two indices, and the terms no volume in common. "measured" keeps them where the error
/// of both terms is under nine tenths of the joint ones'.
///
/// Texels whose D_ref (the root mean square of D, where learned) is under the noise have no colour
/// to scale: their diffuse part is drawn as 0, and metadata "masked_texels" says how many they are.
///
/// Source: Obara, Tsumura, Nakaguchi, Miyake 2006, "Fast BTF rendering for appearance-based display
/// using dichromatic reflection model", sections 3 and 5. Polarised separation: I_par - I_cross is
/// specular, I_cross diffuse.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_dichromatic_lpca(const SampleSet& set,
                                                                     const FitOptions& options,
                                                                     Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_dichromatic_lpca(const SafetensorsFile& file);

}  // namespace veneer::btf
