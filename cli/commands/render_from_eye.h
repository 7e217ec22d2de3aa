// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/result.h"
#include "btf/material.h"
#include "cli/command_line.h"
#include "render/eye_view.h"
#include "render/scene.h"

namespace veneer::cli {

struct RenderFromEyeOptions {
  render::EyeView view;
  std::filesystem::path out;  ///< .png, for people, or .exr: XYZ in cd/m^2 and A, what is hidden
  double white_nits = 0;      ///< what a PNG shows as white, cd/m^2; 0: found in the picture
};

/// `veneer render --from-eye`: what an observer would see of the object, were it of the material.
/// Errors: as render::draw_from_eye(); kInvalidOption (white_nits), kIo.
[[nodiscard]] Result<int> render_from_eye(const render::Scene& scene,
                                          const btf::Material& material,
                                          const RenderFromEyeOptions& options,
                                          CommandLine& line);

}  // namespace veneer::cli
