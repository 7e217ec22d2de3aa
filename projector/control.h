// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace veneer::projector {

enum class Power { kUnknown, kOff, kOn, kCooling, kWarmUp };
enum class Health { kOk, kWarning, kError };
[[nodiscard]] std::string_view name_of(Power power);
[[nodiscard]] std::string_view name_of(Health health);

struct Lamp {
  int hours = 0;
  bool on = false;
  bool operator==(const Lamp&) const = default;
};

/// Levels of the red, green and blue LED, 0 to 255; more is more light, whatever the polarity of
/// the driver's wires.
using LedLevels = std::array<int, 3>;

struct Resolution {
  int width = 0;  ///< pixels
  int height = 0;
  bool operator==(const Resolution&) const = default;
};

/// What a projector tells of itself. What it does not tell stays empty.
struct ProjectorState {
  Power power = Power::kUnknown;
  std::optional<std::string> input;
  std::optional<std::string> input_label;      ///< what the projector's menu calls the input
  std::optional<Resolution> input_resolution;  ///< of what comes in
  std::optional<Resolution> panel_resolution;  ///< of what it has, the recommended one
  std::optional<bool> muted;                   ///< the picture, not the sound
  std::optional<bool> frozen;                  ///< shows an old picture whatever comes in
  std::optional<bool> locked;                  ///< to the signal that comes in
  std::optional<std::vector<Lamp>> lamps;      ///< none at all with most lasers and LEDs
  /// "fan", "lamp", "temperature", "cover", "filter", "other".
  std::map<std::string, Health> health;
  std::optional<bool> degamma;     ///< a tone curve of its own, after the cable
  std::optional<bool> processing;  ///< scales and processes the picture; false: shows it raw
  std::optional<LedLevels> led_levels;
  /// What lights its LEDs: "sequencer", or by hand, as "red blue". Empty while they are dark.
  std::optional<std::string> led_enable;
  std::optional<std::string> maker;
  std::optional<std::string> model;
  std::optional<std::string> name;  ///< that somebody gave it
  std::optional<std::string> serial;
  std::optional<std::string> firmware;
  bool operator==(const ProjectorState&) const = default;
};

/// Keys and values in UTF-8, as they are kept with a profile (ProjectorProfile::record); keys begin
/// with "projector.". Only what the device told.
using ControlRecord = std::map<std::string, std::string>;
[[nodiscard]] ControlRecord to_record(const ProjectorState& state);

/// What changed of that which matters for colour, one sentence each: power, input, its resolution,
/// mute, freeze, degamma, processing, LED levels, what lights the LEDs, which lamps burn, a lamp
/// that was replaced (its hours went down), another device or firmware. What one of the two does
/// not tell is no difference.
[[nodiscard]] std::vector<std::string> differences(const ControlRecord& then,
                                                   const ControlRecord& now);
[[nodiscard]] std::vector<std::string> differences(const ProjectorState& then,
                                                   const ProjectorState& now);
/// What would spoil the colours now, and what to do about it: frozen, muted, degamma on, no
/// lock, an input that is scaled to the panel, a device that is not on, health that is not ok.
/// Empty where all is well.
[[nodiscard]] std::vector<std::string> warnings(const ProjectorState& state);
/// The same without what a profile was measured with, by its record: degamma on, no lock, this
/// scaling, and parts in no better health. Not on, frozen or muted hides the picture, whatever was
/// measured.
[[nodiscard]] std::vector<std::string> warnings(const ProjectorState& state,
                                                const ControlRecord& kept);

/// The machine behind the lens: a way to ask it and to command it, apart from the picture's own.
///
/// One thread at a time. Every call is bounded in time. Errors of all: kNotFound (it cannot be
/// reached), kTimeout (try again), kDisconnected (open again, unless the driver says that it does
/// so itself), kBadFormat (what it says makes no sense), kInvalidOption (a wrong password or
/// value), kUnavailable (this projector cannot, or not now; the text says which), kIo, kCancelled
/// (interrupt() was called).
class ProjectorControl {
 public:
  virtual ~ProjectorControl() = default;
  [[nodiscard]] virtual std::string description() const = 0;
  /// Ends the call that is under way, and every later one, soon and with kCancelled. Any thread.
  /// By default does nothing: for drivers whose calls are short.
  virtual void interrupt() {}
  /// Asks for everything. A device that minds being asked often answers from what it said last.
  [[nodiscard]] virtual Result<ProjectorState> read_state() = 0;
  /// Returns when the command is accepted; warming up and cooling take a minute or more.
  [[nodiscard]] virtual Status power(bool on) = 0;
  /// Blanks the picture, without a word to whoever draws it.
  [[nodiscard]] virtual Status mute(bool on) = 0;
  [[nodiscard]] virtual Status freeze(bool on) = 0;
  /// @param input  as read_state() names it; the driver's README lists them.
  [[nodiscard]] virtual Status select_input(const std::string& input) = 0;

  // What only a bare light engine can; kUnavailable from the others.
  [[nodiscard]] virtual Status set_degamma(bool on);
  [[nodiscard]] virtual Status set_led_levels(const LedLevels& levels);
  /// Whether the picture is processed and scaled (video) or shown raw (pattern).
  [[nodiscard]] virtual Status set_processing(bool on);
  /// Shows one of the device's own patterns.
  [[nodiscard]] virtual Status show_test_pattern(const std::string& name);
};

}  // namespace veneer::projector
