// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <filesystem>
#include <string_view>

#include "base/result.h"
#include "base/unique_handle.h"

namespace veneer {

/// For fuzzers: a file that readers open by its path and no disk ever sees.
class MemoryFile {
 public:
  MemoryFile() : fd_(::memfd_create("veneer", MFD_CLOEXEC)) { VENEER_CHECK(bool(fd_)); }
  /// Replaces its contents; whoever has the old ones mapped must be done with them.
  void write(std::string_view bytes) const {
    VENEER_CHECK(::ftruncate(fd_.value(), 0) == 0);
    VENEER_CHECK(::pwrite(fd_.value(), bytes.data(), bytes.size(), 0) ==
                 static_cast<ssize_t>(bytes.size()));
  }
  [[nodiscard]] std::filesystem::path path() const {
    return fmt::format("/proc/self/fd/{}", fd_.value());
  }

 private:
  UniqueFd fd_;
};

}  // namespace veneer
