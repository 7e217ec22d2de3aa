// SPDX-License-Identifier: Apache-2.0
#include "render/scanout_buffers.h"

#include <drm_fourcc.h>

namespace veneer::render {
namespace {

constexpr const char* kDoing = "importing the display's buffers";

// Of a channel; 0 where the format is none that is drawn into.
int bits_of(std::uint32_t format) {
  if (format == DRM_FORMAT_XRGB8888) return 8;
  if (format == DRM_FORMAT_XRGB2101010) return 10;
  return 0;
}

// "XR24", as tools name it.
std::string name_of(std::uint32_t format) {
  std::string name;
  for (unsigned shift = 0; shift < 32; shift += 8) {
    const auto letter = static_cast<char>((format >> shift) & 0xffU);
    name += letter >= ' ' && letter <= '~' ? letter : '?';
  }
  return name;
}

Status check(const DmaBuffer& buffer, const RasterFormat& raster) {
  const int bits = bits_of(buffer.format);
  if (bits == 0)
    return fail(Errc::kUnavailable,
                "{}: they are {}, and XR24 and XR30 alone are drawn into",
                kDoing,
                name_of(buffer.format));
  if (buffer.width != raster.width || buffer.height != raster.height)
    return fail(Errc::kInvalidOption,
                "{}: they are {} x {}, and the profile is for {} x {} pixels; choose the mode that "
                "was calibrated, or calibrate this one",
                kDoing,
                buffer.width,
                buffer.height,
                raster.width,
                raster.height);
  if (bits < raster.bits)
    return fail(
        Errc::kInvalidOption,
        "{}: they have {} bits a channel, and the profile's codes {}; choose a mode of more "
        "bits, or calibrate this one",
        kDoing,
        bits,
        raster.bits);
  return {};
}

}  // namespace

Result<ScanoutBuffers::Target> ScanoutBuffers::import_one(void* display,
                                                          const DmaBuffer& buffer,
                                                          int bits) {
  std::vector<EGLint> attributes{EGL_WIDTH,
                                 buffer.width,
                                 EGL_HEIGHT,
                                 buffer.height,
                                 EGL_LINUX_DRM_FOURCC_EXT,
                                 static_cast<EGLint>(buffer.format),
                                 EGL_DMA_BUF_PLANE0_FD_EXT,
                                 buffer.descriptor,
                                 EGL_DMA_BUF_PLANE0_OFFSET_EXT,
                                 static_cast<EGLint>(buffer.offset),
                                 EGL_DMA_BUF_PLANE0_PITCH_EXT,
                                 static_cast<EGLint>(buffer.stride)};
  const bool takes_modifiers =
      epoxy_has_egl_extension(display, "EGL_EXT_image_dma_buf_import_modifiers");
  if (buffer.modifier != DRM_FORMAT_MOD_INVALID && takes_modifiers)
    attributes.insert(attributes.end(),
                      {EGL_DMA_BUF_PLANE0_MODIFIER_LO_EXT,
                       static_cast<EGLint>(buffer.modifier & 0xffffffffU),
                       EGL_DMA_BUF_PLANE0_MODIFIER_HI_EXT,
                       static_cast<EGLint>(buffer.modifier >> 32U)});
  attributes.push_back(EGL_NONE);
  EGLImageKHR image =
      eglCreateImageKHR(display, EGL_NO_CONTEXT, EGL_LINUX_DMA_BUF_EXT, nullptr, attributes.data());
  if (image == EGL_NO_IMAGE_KHR)
    return fail(Errc::kUnavailable,
                "{}: the driver refuses a {} x {} {} of modifier {:#x} (EGL error {:#06x})",
                kDoing,
                buffer.width,
                buffer.height,
                name_of(buffer.format),
                buffer.modifier,
                eglGetError());
  Target target{make_renderbuffer(), make_framebuffer(), bits};
  glBindRenderbuffer(GL_RENDERBUFFER, target.memory.id());
  glEGLImageTargetRenderbufferStorageOES(GL_RENDERBUFFER, image);
  eglDestroyImageKHR(display, image);  // the renderbuffer keeps the memory
  glNamedFramebufferRenderbuffer(
      target.framebuffer.id(), GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, target.memory.id());
  // Fewer bits, or another order of the channels, would not be seen otherwise.
  GLint red_bits = 0;
  glGetNamedRenderbufferParameteriv(target.memory.id(), GL_RENDERBUFFER_RED_SIZE, &red_bits);
  if (red_bits != bits || glCheckNamedFramebufferStatus(target.framebuffer.id(), GL_FRAMEBUFFER) !=
                              GL_FRAMEBUFFER_COMPLETE)
    return fail(Errc::kUnavailable,
                "{}: the driver takes a {}, but cannot draw {} bits a channel into it",
                kDoing,
                name_of(buffer.format),
                bits);
  return target;
}

Result<ScanoutBuffers> ScanoutBuffers::import(const EglContext& context,
                                              const std::vector<DmaBuffer>& buffers,
                                              const RasterFormat& raster) {
  for (const DmaBuffer& buffer : buffers) VENEER_TRY(check(buffer, raster));
  for (const char* needed : {"EGL_KHR_image_base", "EGL_EXT_image_dma_buf_import"}) {
    if (!epoxy_has_egl_extension(context.display(), needed))
      return fail(Errc::kUnavailable,
                  "{}: the driver ({}) lacks {}; use an output that copies its pixels",
                  kDoing,
                  context.description(),
                  needed);
  }
  if (!epoxy_has_gl_extension("GL_OES_EGL_image"))
    return fail(Errc::kUnavailable,
                "{}: the driver ({}) lacks GL_OES_EGL_image; use an output that copies its pixels",
                kDoing,
                context.description());
  ScanoutBuffers imported;
  for (const DmaBuffer& buffer : buffers) {
    VENEER_ASSIGN(Target target, import_one(context.display(), buffer, bits_of(buffer.format)));
    imported.targets_.push_back(std::move(target));
  }
  return imported;
}

}  // namespace veneer::render
