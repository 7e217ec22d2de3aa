// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <span>
#include <vector>

#include "base/result.h"
#include "render/draw_pass.h"
#include "render/draw_target.h"
#include "render/drawing.h"
#include "render/fade_mask.h"
#include "render/renderer.h"
#include "render/upsample_pass.h"

namespace veneer::render {

/// Draws the target of a frame by one of several levels, or by two while one takes the other's
/// place. Levels at one scale share what they draw on, levels of one material its textures. Needs a
/// current context, always the same.
class LevelDraws {
 public:
  /// Errors: as DrawPass::create() and DrawingOptions::check(); they say which level of several.
  [[nodiscard]] static Result<LevelDraws> create(const Scene& scene,
                                                 std::span<const Level> levels,
                                                 const calibration::ProjectorProfile& profile);
  /// Draws every level, and every level with the next, so that drivers that finish compiling when a
  /// program first draws do it now.
  void warm_up(const MeshBuffers& mesh) const;
  /// As DrawPass::set_projector().
  void set_projector(const calibration::ProjectorProfile& profile);
  /// @param input  sound; its levels exist (checked).
  void draw(const MeshBuffers& mesh, const FrameInput& input) const;
  /// A frame in which nothing is covered.
  void clear() const { target().clear_colour(); }
  [[nodiscard]] const DrawPass& pass(std::size_t level) const { return levels_[level].pass; }
  /// What was drawn, on the projector's raster.
  [[nodiscard]] const DrawTarget& target() const { return targets_.front(); }

 private:
  struct DrawnLevel {
    DrawPass pass;
    std::size_t target;
  };
  LevelDraws(DrawTarget full, FadeMask mask, UpsamplePass upsample);
  [[nodiscard]] Status add_target(DrawnLevel& level);
  void draw_alone(const DrawnLevel& level, const MeshBuffers& mesh, const DrawInput& input) const;
  void draw_on_one(const DrawnLevel& level,
                   const DrawnLevel& next,
                   float fade,
                   const MeshBuffers& mesh,
                   const DrawInput& input) const;
  void draw_on_two(const DrawnLevel& level,
                   const DrawnLevel& next,
                   float fade,
                   const MeshBuffers& mesh,
                   const DrawInput& input) const;
  [[nodiscard]] FadeMask::Raster raster_of(const DrawTarget& target) const;
  std::vector<DrawTarget> targets_;  // the projector's raster first
  std::vector<DrawnLevel> levels_;
  FadeMask mask_;
  UpsamplePass upsample_;
};

}  // namespace veneer::render
