// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <cstddef>
#include <span>
#include <vector>

#include "render/draw_pass.h"
#include "render/screen_probe.h"

namespace veneer::render {

/// probe_scene() of one frame, in the current context.
[[nodiscard]] Result<ProbedScreen> probe_screen(const MeshBuffers& mesh,
                                                const DrawInput& input,
                                                std::span<const Light> lights,
                                                const Eigen::Vector2d& repeats,
                                                const calibration::ProjectorProfile& profile,
                                                const ScreenProbeOptions& options);

/// Sums of |drawn - reference|, both over what a white that faces all lights sends (the sample's
/// unit), cut to [0, 1] and encoded with 1/2.2.
struct ScreenError {
  double sum = 0;
  double squares = 0;
  std::size_t count = 0;  ///< of values: three for each pixel

  [[nodiscard]] double epsilon() const { return count > 0 ? sum / static_cast<double>(count) : 0; }
  [[nodiscard]] double rmse() const;
};

/// @param target  what DrawPass left, XYZ and G for each pixel.
void add_error(std::span<const Eigen::Vector4f> target,
               std::span<const ScreenQuery> queries,
               std::span<const Eigen::Vector3d> reference,
               ScreenError& error);

}  // namespace veneer::render
