// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "projector/control.h"
#include "projector/control/dlpc350/dlpc350_protocol.h"

namespace veneer::projector {

struct Dlpc350Options {
  std::string serial;  ///< which one, where there are several
  /// What lights the LEDs after a blank of which nobody here knows, as ProjectorState::led_enable
  /// says it. The device forgets it while they are dark; after its start it is "sequencer".
  std::string led_enable = "sequencer";
  /// For each message.
  Duration time_limit = std::chrono::seconds(2);
};

/// A light engine that is plugged in.
struct ConnectedLightEngine {
  std::string node;  ///< "/dev/hidraw3"
  std::string model;
  std::string serial;  ///< empty where it has none
  bool may_open = false;
};
/// Those on USB, only the interface that takes commands. Opens none of them.
[[nodiscard]] std::vector<ConnectedLightEngine> connected_light_engines();

/// A DLPC350 over HID.
class Dlpc350 final : public ProjectorControl {
 public:
  /// Keys: serial, led_enable. Opens the device. Errors: kNotFound (it is not there), kUnavailable
  /// (it may not be opened), kInvalidOption (several are there, or a wrong value), and those of a
  /// conversation.
  [[nodiscard]] static Result<std::unique_ptr<Dlpc350>> open(TomlReader& config, Clock& clock);
  [[nodiscard]] static Result<std::unique_ptr<Dlpc350>> open(const Dlpc350Options& options,
                                                             Clock& clock);
  ~Dlpc350() override;

  [[nodiscard]] std::string description() const override;
  void interrupt() override { interrupted_ = true; }
  [[nodiscard]] Result<ProjectorState> read_state() override;
  [[nodiscard]] Status power(bool on) override;
  /// Switches its LEDs off: black mirrors still leak light. They come back as they were where this
  /// object switched them off, else by the option led_enable.
  [[nodiscard]] Status mute(bool on) override;
  [[nodiscard]] Status freeze(bool on) override;
  [[nodiscard]] Status select_input(const std::string& input) override;
  [[nodiscard]] Status set_degamma(bool on) override;
  [[nodiscard]] Status set_led_levels(const LedLevels& levels) override;
  [[nodiscard]] Status set_processing(bool on) override;
  /// Selects the input "test-pattern" too, and goes back to the one of before where it is refused.
  [[nodiscard]] Status show_test_pattern(const std::string& name) override;

 private:
  class Device;
  Dlpc350(const Dlpc350Options& options,
          std::uint8_t led_enable,
          std::unique_ptr<Device> device,
          Clock& clock);
  /// Empty where the device refuses (NACK).
  [[nodiscard]] Result<std::optional<dlpc350::Bytes>> exchange(
      dlpc350::Command command, const std::vector<dlpc350::Report>& request, bool is_read);
  [[nodiscard]] Result<std::optional<dlpc350::Bytes>> read(dlpc350::Command command);
  [[nodiscard]] Result<std::optional<std::uint8_t>> read_byte(dlpc350::Command command);
  /// The same for what a command needs: a refusal is an error.
  [[nodiscard]] Result<std::uint8_t> require_byte(dlpc350::Command command);
  [[nodiscard]] Status write(dlpc350::Command command, std::span<const std::byte> parameters);
  [[nodiscard]] Status write(dlpc350::Command command, std::uint8_t parameter);

  Dlpc350Options options_;
  std::unique_ptr<Device> device_;
  Clock& clock_;
  std::atomic<bool> interrupted_{false};
  std::uint8_t sequence_ = 0;
  std::uint8_t led_enable_;  // to come back to from mute
};

}  // namespace veneer::projector
