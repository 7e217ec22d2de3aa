// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "base/toml_reader.h"
#include "projector/output.h"
#include "projector/outputs/window/displays.h"

namespace veneer::projector {

struct WindowOutputOptions {
  int display = 0;         ///< as list_displays() numbers them
  bool fullscreen = true;  ///< false: a window of the picture's size, for the desk
  [[nodiscard]] Status check() const;
};

/// A window on the desktop: for the desk and for calibration. Code values reach the window system
/// unchanged; what a compositor or a graphics driver does to them afterwards (colour management,
/// gamma tables) it cannot know. There is no waiting for the vertical retrace. Made and used on one
/// thread, and that should be the program's first.
class WindowOutput final : public Output {
 public:
  /// Errors: kInvalidOption, kUnavailable (no desktop, no such display; names those there are).
  [[nodiscard]] static Result<std::unique_ptr<WindowOutput>> open(TomlReader& config);
  [[nodiscard]] static Result<std::unique_ptr<WindowOutput>> open(
      const WindowOutputOptions& options);
  ~WindowOutput() override;

  [[nodiscard]] const Display& display() const;
  [[nodiscard]] std::string description() const override;
  [[nodiscard]] bool wants_pixels(std::uint64_t /*frame_number*/) const override { return true; }
  /// Errors: kInvalidOption (more than 8 bits; full screen and another size than the display),
  /// kCancelled (the window was closed, or Escape pressed), kIo.
  [[nodiscard]] Status present(const Frame& frame) override;

 private:
  struct State;
  explicit WindowOutput(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::projector
