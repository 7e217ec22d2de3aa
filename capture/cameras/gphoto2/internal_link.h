// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gphoto2/gphoto2.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/result.h"

// libgphoto2 in our words. Each call may take as long as the camera lets it: see within().
namespace veneer::capture {

struct UnrefContext {
  void operator()(GPContext* context) const { gp_context_unref(context); }
};
struct FreeCamera {
  void operator()(::Camera* camera) const { gp_camera_unref(camera); }
};

/// A camera that may be there.
struct GphotoAddress {
  std::string model;
  std::string port;
};

/// "/dev/bus/usb/001/004" of the port "usb:001,004"; empty for other ports.
[[nodiscard]] std::filesystem::path usb_node(const std::string& port);
/// What stands in the way of a camera at that port; empty where nothing is seen.
[[nodiscard]] std::string obstacle(const std::string& port);
/// Cameras on USB. Errors: kIo.
[[nodiscard]] Result<std::vector<GphotoAddress>> find_gphoto_cameras();

/// A picture as the camera made it.
struct TakenFile {
  std::string name;
  std::string bytes;
  bool encoded = false;  ///< JPEG or HEIF: not linear
  Time begin;            ///< when the camera was told to take it
};

/// One setting with a list of values.
struct CameraChoice {
  std::string name;
  std::string now;
  std::vector<std::string> values;
};

/// A connection to a camera. One thread at a time.
class GphotoLink {
 public:
  /// Errors: kNotFound, kUnavailable (held by another program, which is named; no permission),
  /// kIo.
  [[nodiscard]] static Result<std::unique_ptr<GphotoLink>> open(const GphotoAddress& address);
  GphotoLink(const GphotoLink&) = delete;
  GphotoLink& operator=(const GphotoLink&) = delete;
  ~GphotoLink();

  [[nodiscard]] const std::string& serial() const { return serial_; }
  /// The first of `names` that the camera has: makers call one thing by several.
  /// Errors: kUnavailable (none of them), kDisconnected.
  [[nodiscard]] Result<CameraChoice> choice(const std::vector<std::string>& names);
  /// Sets one of its values and makes sure that it was taken; a busy camera gets some time.
  /// Errors: kInvalidOption (no such value; the text has them all), kUnavailable (refused),
  /// kTimeout (busy), kDisconnected.
  [[nodiscard]] Status set(const CameraChoice& choice, const std::string& value);
  /// Takes a picture, fetches it and deletes it on the camera. Of a pair it is the RAW file.
  /// @param patience  how long it may take from its release to its first sign.
  /// @param wait_for_raw  how long to wait for the RAW file where an encoded one comes first.
  /// Errors: kTimeout (busy, or no picture came), kIo (the camera refused), kDisconnected.
  [[nodiscard]] Result<TakenFile> shoot(Duration patience, Duration wait_for_raw);

 private:
  GphotoLink();
  [[nodiscard]] tl::unexpected<Error> failed(const std::string& doing, int code);
  /// Repeats what `call` does while the camera says that it is busy, a few times.
  template <class Call>
  [[nodiscard]] int patiently(Call call);
  /// Releases, and waits for the files that come of it.
  [[nodiscard]] Result<std::vector<CameraFilePath>> release(const std::string& doing,
                                                            Time& begin,
                                                            Duration patience,
                                                            Duration wait_for_raw);
  [[nodiscard]] bool answers();
  void forget_events();

  std::unique_ptr<GPContext, UnrefContext> context_;
  std::unique_ptr<::Camera, FreeCamera> camera_;
  GphotoAddress address_;
  std::string serial_;
  std::string said_;  // the last text that the library had for an error
};

}  // namespace veneer::capture
