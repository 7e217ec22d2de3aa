// SPDX-License-Identifier: Apache-2.0
#include "daemon/file_identity.h"

#include <sys/stat.h>

namespace veneer::daemon {

std::optional<FileIdentity> identify(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return FileIdentity{
      status.st_dev, status.st_ino, status.st_mtim.tv_sec, status.st_mtim.tv_nsec, status.st_size};
}

}  // namespace veneer::daemon
