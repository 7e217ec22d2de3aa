// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/internal_holders.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <functional>
#include <string_view>

namespace veneer::capture {
namespace {

namespace fs = std::filesystem;

/// Folders of /proc come and go while they are read: whatever fails is one that went.
std::vector<Holder> processes_that(
    const std::function<bool(const fs::path&, const Holder&)>& do_so) {
  std::vector<Holder> found;
  std::error_code gone;
  for (fs::directory_iterator entry("/proc", gone), end; !gone && entry != end;
       entry.increment(gone)) {
    const std::string name = entry->path().filename();
    Holder holder;
    const auto [stop, error] =
        std::from_chars(name.data(), name.data() + name.size(), holder.process);
    if (error != std::errc{} || stop != name.data() + name.size()) continue;
    if (holder.process == ::getpid()) continue;
    std::ifstream comm(entry->path() / "comm");
    std::getline(comm, holder.name);
    if (do_so(entry->path(), holder)) found.push_back(std::move(holder));
  }
  std::sort(found.begin(), found.end(), [](const Holder& a, const Holder& b) {
    return a.process < b.process;
  });
  return found;
}

bool same_node(const struct stat& a, const struct stat& b) {
  if (S_ISCHR(a.st_mode) && S_ISCHR(b.st_mode)) return a.st_rdev == b.st_rdev;
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

}  // namespace

std::vector<Holder> holders_of(const fs::path& node) {
  struct stat wanted {};
  if (::stat(node.c_str(), &wanted) != 0) return {};
  return processes_that([&](const fs::path& process, const Holder&) {
    std::error_code gone;
    for (fs::directory_iterator fd(process / "fd", gone), end; !gone && fd != end;
         fd.increment(gone)) {
      struct stat open {};
      if (::stat(fd->path().c_str(), &open) == 0 && same_node(open, wanted)) return true;
    }
    return false;
  });
}

std::vector<Holder> camera_grabbers() {
  return processes_that([](const fs::path&, const Holder& holder) {
    return holder.name.starts_with("gvfsd-gphoto2") || holder.name.starts_with("gvfs-gphoto2");
  });
}

std::string text_of(const std::vector<Holder>& holders) {
  std::string text;
  for (const Holder& holder : holders) {
    text += fmt::format("{}{} (process {})", text.empty() ? "" : ", ", holder.name, holder.process);
  }
  if (text.empty()) return text;
  return text + (holders.size() == 1 ? " holds it" : " hold it");
}

}  // namespace veneer::capture
