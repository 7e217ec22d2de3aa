// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "base/result.h"

namespace veneer::render {

/// An OpenGL 4.5 core context without a window or a display server, made current on the thread that
/// creates it. One thread at a time has it: until it calls release(), then the next that calls
/// make_current(). It may go on any thread, if none or that one has it; what was made in it must go
/// before, while it is current.
///
/// Where several drivers are installed the first that gives such a context is taken: hardware
/// through EGL_EXT_platform_device (NVIDIA's driver, and Mesa's for a GPU), then Mesa's surfaceless
/// platform, then software through the device platform. The environment variable VENEER_EGL narrows
/// that to platforms whose name contains its value ("surfaceless", "device 1"). In debug builds,
/// and wherever VENEER_GL_DEBUG is set, GL reports its errors through KHR_debug to the log. Where
/// the driver can tell of a reset of the GPU, the context asks for it; where it cannot,
/// description() says so.
class EglContext {
 public:
  /// Errors: kUnavailable; says what was tried, what each said and what to install.
  [[nodiscard]] static Result<EglContext> create();
  /// On a display's device, so that its buffers can be drawn into.
  /// @param gbm_device  struct gbm_device*, borrowed; must outlive the context.
  /// Errors: kUnavailable, as create().
  [[nodiscard]] static Result<EglContext> create_on(void* gbm_device);
  EglContext(EglContext&&) noexcept;
  EglContext& operator=(EglContext&&) = delete;
  ~EglContext();

  /// Makes this context the thread's current one; costs next to nothing where it already is. No
  /// other thread may have it (checked). A lost one may leave the thread without any, and then GL
  /// commands do nothing.
  void make_current() const;
  /// Leaves the thread without a context, so that another thread can make this one its own.
  void release() const;
  /// Whether the GPU was reset and the context with all in it is gone for good. Neither waits nor
  /// allocates. False where the driver does not tell of resets.
  [[nodiscard]] bool lost() const;
  /// Its EGLDisplay.
  [[nodiscard]] void* display() const;
  /// "llvmpipe (LLVM 15.0.6, 256 bits), 4.5 (Core Profile) Mesa 22.3.6, through surfaceless".
  [[nodiscard]] const std::string& description() const;
  /// Whether processors draw, in the calls of GL and on threads of the driver.
  [[nodiscard]] bool is_software() const;

 private:
  struct State;
  explicit EglContext(std::unique_ptr<State> state);
  static Status find_library();
  std::unique_ptr<State> state_;
};

}  // namespace veneer::render
