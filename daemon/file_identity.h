// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace veneer::daemon {

/// Which file stands at a path: one that took another's place is another file, one that was written
/// over has another time.
struct FileIdentity {
  std::uint64_t device = 0;
  std::uint64_t file = 0;
  std::int64_t seconds = 0;
  std::int64_t nanoseconds = 0;
  std::int64_t bytes = 0;
  bool operator==(const FileIdentity&) const = default;
};
/// None where there is none, or nobody may look.
[[nodiscard]] std::optional<FileIdentity> identify(const std::filesystem::path& path);

}  // namespace veneer::daemon
