// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <string>

#include "base/result.h"
#include "service/status.h"

namespace veneer::service {

/// A directional light of the scene that is shown.
struct LightSetting {
  Eigen::Vector3d direction_to_light{0, 0, 1};  ///< world frame; any length but zero
  double illuminance_lux = 0;                   ///< on a plane facing it; 0 or more
  Eigen::Vector3d colour{1, 1, 1};              ///< linear sRGB, multiplies; 0 or more
  /// Errors: kInvalidOption (not finite, negative, no direction, over 1e6 lux).
  [[nodiscard]] Status check() const;
};

/// What a running veneerd can be told and asked: the face that D-Bus, systemd and metrics see. The
/// daemon implements it. Any thread may call; calls return within ten seconds, reload() within two
/// minutes. What is refused changes nothing, and what is shown stays.
class ServiceControl {
 public:
  virtual ~ServiceControl() = default;
  [[nodiscard]] virtual ServiceStatus status() const = 0;
  /// Frames that went out since the start, dark ones included; cheap.
  [[nodiscard]] virtual std::uint64_t frames() const = 0;
  /// The same, and those that the display refused, which the state `fault` tells: what a watchdog
  /// asks, since a new start brings no display back. Cheap.
  [[nodiscard]] virtual std::uint64_t turns() const = 0;

  /// Errors of the following: kNotFound, kBadFormat, kInvalidOption (refused, the text says why),
  /// kTimeout (it was still busy), kUnavailable (stopping).
  [[nodiscard]] virtual Status load_material(const std::filesystem::path& material) = 0;
  [[nodiscard]] virtual Status set_scene(const std::filesystem::path& scene) = 0;
  /// @param index  which of the scene's lights is replaced, from 0.
  [[nodiscard]] virtual Status set_light(int index, const LightSetting& light) = 0;
  /// Dark, until it is taken back.
  [[nodiscard]] virtual Status blank(bool on) = 0;
  /// Reads the configuration anew, and the scene, material and profile that it names; what SIGHUP
  /// does. What only a start takes is left as it was, with a warning in the log.
  [[nodiscard]] virtual Status reload() = 0;
  /// Writes the next frame's codes as a PNG into the state directory. Returns its path.
  [[nodiscard]] virtual Result<std::filesystem::path> snapshot() = 0;
};

}  // namespace veneer::service
