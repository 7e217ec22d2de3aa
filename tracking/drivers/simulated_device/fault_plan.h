// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <limits>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/toml_reader.h"

namespace veneer::tracking {

/// What may go wrong with a tracker.
enum class FaultKind {
  kBitFlip,       ///< one bit of a frame
  kBurst,         ///< `samples` frames arrive together, with the last of them
  kClockFreeze,   ///< the device's clock stands still
  kClockRestart,  ///< it begins again at zero
  kDelay,         ///< frames arrive up to `delay_ms` late, in order
  kDrop,          ///< frames are lost
  kDuplicate,     ///< frames arrive twice
  kGarbage,       ///< random bytes before a frame
  kInvalid,       ///< poses that are none: NaN, infinities, 1e30, denormals, zero quaternions
  kIoError,       ///< reads fail
  kMirror,        ///< the wrong hemisphere: positions of the other sign
  kOtherDevice,   ///< another device is plugged in
  kReorder,       ///< frames arrive after `samples` later ones
  kSilence,       ///< the device sends nothing
  kStall,         ///< its endpoint halts
  kTeleport,      ///< poses are `shift` away
  kText,          ///< the device resets itself and speaks text
  kThin,          ///< only one frame of `samples` is sent
  kUnplug,
};

/// One [[tracker.fault]] table.
struct Fault {
  FaultKind kind = FaultKind::kDrop;
  double at_s = 0;      ///< since the tracker was opened
  double for_s = 0;     ///< how long; what happens once (restart, text, other device) needs none
  double share = 1;     ///< of the frames within that time. 0 to 1
  int body = 0;         ///< whose frames, where it strikes single ones; 0: all
  int samples = 1;      ///< 1 to 1000
  double delay_ms = 0;  ///< 0 to 10000
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  [[nodiscard]] bool covers(double seconds) const {
    return seconds >= at_s && seconds < at_s + for_s;
  }
};

/// The name of a kind as it stands in a plan: "bit-flip".
[[nodiscard]] std::string_view name_of(FaultKind kind);

/// Reads the [[fault]] tables of `toml`; mistakes are recorded there.
[[nodiscard]] std::vector<Fault> read_faults(TomlReader& toml);

}  // namespace veneer::tracking
