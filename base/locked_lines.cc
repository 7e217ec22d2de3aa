// SPDX-License-Identifier: Apache-2.0
#include "base/locked_lines.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "base/files.h"

namespace veneer {
namespace {

std::string system_message(int error) {
  return std::error_code(error, std::generic_category()).message();
}

}  // namespace

Result<std::size_t> take_lines(std::string_view text,
                               const std::function<Result<bool>(std::string_view line)>& take) {
  std::size_t understood = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string_view::npos) break;  // cut off while it was written
    VENEER_ASSIGN(const bool good, take(text.substr(begin, end - begin)));
    begin = end + 1;
    if (!good) {
      if (begin == text.size()) break;
      return fail(Errc::kBadFormat, "it is damaged at byte {}", understood);
    }
    understood = begin;
  }
  return understood;
}

Result<LockedLines> LockedLines::open(const std::filesystem::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644));
  if (!fd) return fail(Errc::kIo, "opening {}: {}", path.string(), system_message(errno));
  if (::flock(fd.value(), LOCK_EX | LOCK_NB) != 0)
    return fail(Errc::kUnavailable, "opening {}: another program has it open", path.string());
  return LockedLines(path, std::move(fd));
}

Status LockedLines::take(const std::function<Result<bool>(std::string_view line)>& take) {
  VENEER_ASSIGN(const std::string text, read_text(path_));
  VENEER_ASSIGN(const std::size_t understood, take_lines(text, take));
  if (understood < text.size() && ::ftruncate(fd_.value(), static_cast<off_t>(understood)) != 0)
    return fail(Errc::kIo,
                "cutting off an unfinished line of {}: {}",
                path_.string(),
                system_message(errno));
  return {};
}

Status LockedLines::append(std::string_view line) {
  const std::string text = std::string(line) + "\n";
  const off_t before = ::lseek(fd_.value(), 0, SEEK_END);
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t count = ::write(fd_.value(), text.data() + written, text.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    written += static_cast<std::size_t>(count);
  }
  if (written == text.size() && ::fdatasync(fd_.value()) == 0) return {};
  const std::string why = system_message(errno);
  // What was written of the line would spoil the next one. Where even that fails, the next start
  // drops it.
  if (before >= 0 && ::ftruncate(fd_.value(), before) != 0) fd_.reset();
  return fail(Errc::kIo,
              "writing {}: {}; make room, then run the same command again: it goes on from here",
              path_.string(),
              why);
}

Status LockedLines::clear() {
  if (::ftruncate(fd_.value(), 0) == 0) return {};
  return fail(Errc::kIo, "emptying {}: {}", path_.string(), system_message(errno));
}

}  // namespace veneer
