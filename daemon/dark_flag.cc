// SPDX-License-Identifier: Apache-2.0
#include "daemon/dark_flag.h"

#include <fcntl.h>

#include <cerrno>
#include <system_error>

#include "base/unique_handle.h"

namespace veneer::daemon {

DarkFlag::DarkFlag(const std::filesystem::path& folder)
    : path_(folder.empty() ? std::filesystem::path() : folder / kFile) {}

bool DarkFlag::is_up() const {
  if (path_.empty()) return false;
  // What cannot be looked at may be there.
  std::error_code doubt;
  const auto status = std::filesystem::symlink_status(path_, doubt);
  return status.type() != std::filesystem::file_type::not_found;
}

Status DarkFlag::put(bool up) const {
  if (path_.empty()) return {};
  std::error_code error;
  if (up) {
    constexpr mode_t kForUsAndOurGroup = 0640;
    const UniqueFd made(
        ::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, kForUsAndOurGroup));
    if (!made) error = std::error_code(errno, std::generic_category());
  } else {
    std::filesystem::remove(path_, error);
  }
  if (!error) return {};
  return fail(Errc::kIo,
              "remembering in {} that the dark was {}: {}",
              path_.string(),
              up ? "asked for" : "taken back",
              error.message());
}

}  // namespace veneer::daemon
