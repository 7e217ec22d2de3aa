// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/result.h"

namespace veneer::daemon {

/// Remembers beyond a crash that the dark was asked for, by a file in a folder that lives as long
/// as the service does: systemd's RuntimeDirectory, kept from one process to the next. The file is
/// the flag, whatever is in it. One thread at a time.
class DarkFlag {
 public:
  static constexpr const char* kFile = "dark";

  /// @param folder  empty: nothing is remembered.
  explicit DarkFlag(const std::filesystem::path& folder);
  /// Whether the dark was asked for and not taken back; true where that cannot be told.
  [[nodiscard]] bool is_up() const;
  /// Errors: kIo (a full disk); a flag that is down stays down then, one that is up stays up.
  [[nodiscard]] Status put(bool up) const;

 private:
  const std::filesystem::path path_;
};

}  // namespace veneer::daemon
