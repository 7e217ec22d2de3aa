// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <vector>

#include "base/scanout.h"
#include "render/egl_context.h"
#include "render/gl_objects.h"
#include "render/prepared_profile.h"

namespace veneer::render {

/// A display's buffers as framebuffers of GL. Needs the context that they were imported in to be
/// current.
class ScanoutBuffers {
 public:
  /// @param context  current, on the device that the buffers are of.
  /// @param raster  of the codes that they will show.
  /// Errors: kInvalidOption (a buffer of another size, or of fewer bits than the codes),
  /// kUnavailable (a format that is not known, a driver that cannot draw into such memory; says
  /// which).
  [[nodiscard]] static Result<ScanoutBuffers> import(const EglContext& context,
                                                     const std::vector<DmaBuffer>& buffers,
                                                     const RasterFormat& raster);
  [[nodiscard]] std::size_t size() const { return targets_.size(); }
  [[nodiscard]] GLuint framebuffer(std::size_t buffer) const {
    return targets_[buffer].framebuffer.id();
  }
  /// Of a channel.
  [[nodiscard]] int bits(std::size_t buffer) const { return targets_[buffer].bits; }

 private:
  struct Target {
    GlRenderbuffer memory;
    GlFramebuffer framebuffer;
    int bits = 0;
  };
  static Result<Target> import_one(void* display, const DmaBuffer& buffer, int bits);
  std::vector<Target> targets_;
};

}  // namespace veneer::render
