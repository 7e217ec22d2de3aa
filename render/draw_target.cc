// SPDX-License-Identifier: Apache-2.0
#include "render/draw_target.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace veneer::render {

Eigen::Vector2i scaled_raster(const Eigen::Vector2i& full, double scale) {
  // A product that should be whole may come out just above.
  constexpr double kRounding = 1e-9;
  const auto side = [scale](int pixels) {
    return std::max(1, static_cast<int>(std::ceil(pixels * scale - kRounding)));
  };
  return {side(full.x()), side(full.y())};
}

DrawTarget::DrawTarget(const Eigen::Vector2i& size)
    : size_(size),
      colour_(make_texture_2d(GL_RGBA16F, size.x(), size.y())),
      depth_(make_texture_2d(GL_DEPTH_COMPONENT32F, size.x(), size.y())),
      framebuffer_(make_framebuffer()) {
  glNamedFramebufferTexture(framebuffer_.id(), GL_COLOR_ATTACHMENT0, colour_.id(), 0);
  glNamedFramebufferTexture(framebuffer_.id(), GL_DEPTH_ATTACHMENT, depth_.id(), 0);
}

Result<DrawTarget> DrawTarget::create(const Eigen::Vector2i& size) {
  DrawTarget target(size);
  if (glCheckNamedFramebufferStatus(target.framebuffer(), GL_FRAMEBUFFER) !=
      GL_FRAMEBUFFER_COMPLETE)
    return fail(Errc::kUnavailable,
                "making a renderer: this GL cannot draw to half floats with depth");
  return target;
}

void DrawTarget::clear_colour() const {
  constexpr std::array<GLfloat, 4> kNothing{};
  glClearNamedFramebufferfv(framebuffer_.id(), GL_COLOR, 0, kNothing.data());
}

}  // namespace veneer::render
