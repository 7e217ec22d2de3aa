// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "base/clock.h"
#include "daemon/faults.h"
#include "projector/control_watch.h"

namespace veneer::daemon {

/// Watches the projector's own state beside the picture, and makes faults of it: kProjector while
/// it does not answer, kProjectorState while it is not as it was when the profile was measured or
/// says of itself what spoils colours.
class ProjectorCare {
 public:
  /// @param profile  the folder that `kept` is of.
  /// Borrows the faults and the clock.
  ProjectorCare(projector::ControlWatch::Open open,
                projector::ControlRecord kept,
                std::filesystem::path profile,
                const projector::ControlWatchOptions& options,
                Faults& faults,
                Clock& clock);

  /// Does what is due. One thread, which may wait for the disk.
  /// @param profile  the folder of the profile that is drawn with.
  /// @param changes  ShowLoader::profile_changes(). With another folder or number the record that
  ///                 the projector is compared with is read again.
  void look(const std::filesystem::path& profile, std::uint64_t changes);
  /// A line on the projector. Any thread.
  [[nodiscard]] std::string text() const { return watch_.report().text; }

 private:
  std::filesystem::path profile_;
  std::uint64_t changes_ = 0;
  Faults& faults_;
  Clock& clock_;
  projector::ControlWatch watch_;
};

}  // namespace veneer::daemon
