// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.h"

namespace veneer::capture {

/// What lies in the sample's place.
enum class Target : std::uint8_t {
  kSample,
  kWhite,   ///< a diffuser of known reflectance, which depolarises: pressed PTFE or barium sulphate
  kMirror,  ///< a metal mirror, turned so that it sends the light into the camera
  kMirrorBall,  ///< a polished ball, in whose highlight the light's direction is read
};

/// "sample", "white", "mirror", "mirror-ball": in files and texts.
[[nodiscard]] std::string_view text_of(Target target);

/// Something that is done at the rig between two pictures.
struct HandRequest {
  enum class Task : std::uint8_t {
    kPlaceTarget,   ///< `target`
    kPlaceView,     ///< camera or sample, so that it is seen from view number `index`
    kPlaceLight,    ///< light number `index`
    kDarken,        ///< no light from the projector: lid, shutter, black picture
    kLight,         ///< full light again
    kTurnAnalyser,  ///< so that its axis is at `angle_rad`, see PolarisationAxes
  };
  Task task = Task::kPlaceTarget;
  Target target = Target::kSample;
  int index = 0;
  double angle_rad = 0;
  std::string text;  ///< what to do, in words
};

/// Whoever changes the rig between two pictures: a person, motors, the virtual studio.
class Hands {
 public:
  virtual ~Hands() = default;
  /// Waits until it was done. Errors: kCancelled (the person wants to stop; nothing is lost),
  /// kTimeout, kDisconnected, kUnavailable (nobody can do it).
  [[nodiscard]] virtual Status please(const HandRequest& request) = 0;
  /// Something that the person should know.
  virtual void say(std::string_view text) = 0;
};

}  // namespace veneer::capture
