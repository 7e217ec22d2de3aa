// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace veneer::capture {

/// A program that has a device open.
struct Holder {
  pid_t process = 0;
  std::string name;  ///< as the kernel keeps it: cut to 15 characters
};

/// Programs other than this one that have `node` open, as far as /proc shows: those of other users
/// stay hidden from whoever is not root. Sorted by process.
[[nodiscard]] std::vector<Holder> holders_of(const std::filesystem::path& node);
/// GNOME's programs that take every camera that is plugged in, where they run: they let go of it in
/// between, so that none need be seen holding it.
[[nodiscard]] std::vector<Holder> camera_grabbers();
/// "gvfsd-gphoto2 (process 812) holds it"; empty where there are none.
[[nodiscard]] std::string text_of(const std::vector<Holder>& holders);

}  // namespace veneer::capture
