// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"
#include "btf/models/layered/layer_stack.h"

namespace veneer::btf {

/// Semi-transparent layers at several heights (layer_stack.h), each texel of each with Lafortune's
/// lobe, a normal, a transmittance and a diffuse radiance: Magda and Kriegman 2005, "Reconstruction
/// of Volumetric Surface Textures for Real-Time Rendering". The one model with parallax and with a
/// contour (ModelShader::shells). Reads FitOptions::layers and ::heights.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_layered(const SampleSet& set,
                                                            const FitOptions& options,
                                                            Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_layered(const SafetensorsFile& file);

/// A material of a stack that is at hand. @param frame  of the stack's size.
[[nodiscard]] std::unique_ptr<Material> layered_material(MaterialFrame frame, LayerStack stack);

}  // namespace veneer::btf
