// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <Eigen/Core>

#include "base/result.h"
#include "render/gl_objects.h"

namespace veneer::render {

/// The raster that is drawn at a scale of the projector's: both show the same picture from edge to
/// edge, so that a pixel of it is full / scaled pixels of the projector wide, just above 1 / scale
/// at most.
[[nodiscard]] Eigen::Vector2i scaled_raster(const Eigen::Vector2i& full, double scale);

/// What draw passes draw into: XYZ in cd/m^2 and the geometric factor in half floats, with depth.
/// Needs a current context, always the same.
class DrawTarget {
 public:
  /// Errors: kUnavailable (this GL cannot draw to it).
  [[nodiscard]] static Result<DrawTarget> create(const Eigen::Vector2i& size);
  /// Nothing is covered; depth stays.
  void clear_colour() const;
  [[nodiscard]] GLuint colour() const { return colour_.id(); }
  [[nodiscard]] GLuint framebuffer() const { return framebuffer_.id(); }
  [[nodiscard]] const Eigen::Vector2i& size() const { return size_; }

 private:
  explicit DrawTarget(const Eigen::Vector2i& size);
  Eigen::Vector2i size_;
  GlTexture colour_;
  GlTexture depth_;
  GlFramebuffer framebuffer_;
};

}  // namespace veneer::render
