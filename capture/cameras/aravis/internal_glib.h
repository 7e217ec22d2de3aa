// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arv.h>

#include <memory>

namespace veneer::capture {

struct UnrefObject {
  void operator()(gpointer object) const { g_object_unref(object); }
};
template <class T>
using GObjectPtr = std::unique_ptr<T, UnrefObject>;

struct FreeMemory {
  void operator()(gpointer memory) const { g_free(memory); }
};
template <class T>
using GMemory = std::unique_ptr<T, FreeMemory>;

/// Takes the error that a function of GLib hands out; empty where it did not fail.
class GlibError {
 public:
  GlibError() = default;
  GlibError(const GlibError&) = delete;
  GlibError& operator=(const GlibError&) = delete;
  ~GlibError() { g_clear_error(&error_); }
  /// For the function's last argument; drops an earlier error.
  [[nodiscard]] GError** out() {
    g_clear_error(&error_);
    return &error_;
  }
  explicit operator bool() const { return error_ != nullptr; }
  [[nodiscard]] const char* text() const { return error_ != nullptr ? error_->message : ""; }
  [[nodiscard]] bool is_device(ArvDeviceError code) const {
    return g_error_matches(error_, ARV_DEVICE_ERROR, code) != FALSE;
  }

 private:
  GError* error_ = nullptr;
};

}  // namespace veneer::capture
