// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/journal.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "base/files.h"

namespace veneer::calibration {
namespace {

using nlohmann::json;

constexpr std::string_view kFormat = "veneer-calibration-session";
constexpr int kVersion = 1;

std::string system_message() { return std::error_code(errno, std::generic_category()).message(); }

/// "bench: a.toml, not b.toml" for the first thing in which they differ.
std::string difference(const json& there, const json& here) {
  for (const auto& [key, value] : here.items()) {
    const json old = there.value(key, json());
    if (old != value) return fmt::format("its {} is {}, not {}", key, old.dump(), value.dump());
  }
  return "it knows of something that this one does not";
}

}  // namespace

Result<Journal> Journal::open(const std::filesystem::path& folder,
                              const json& identity,
                              bool restart) {
  const std::filesystem::path path = folder / "journal.jsonl";
  const std::string doing = fmt::format("opening the session {}", folder.string());
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return fail(Errc::kIo, "{}: {}", doing, error.message());
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644));
  if (!fd) return fail(Errc::kIo, "{}: {}", doing, system_message());
  if (::flock(fd.value(), LOCK_EX | LOCK_NB) != 0)
    return fail(Errc::kUnavailable,
                "{}: another program is calibrating in it; let that one finish, or name another "
                "session with --session",
                doing);
  if (restart && ::ftruncate(fd.value(), 0) != 0)
    return fail(Errc::kIo, "{}: forgetting what was found: {}", doing, system_message());
  VENEER_ASSIGN(const std::string text, read_text(path));
  Journal journal(path, std::move(fd));
  if (const Status taken = journal.take(text, identity); !taken)
    return fail_while(doing, taken.error());
  return journal;
}

Status Journal::take(const std::string& text, const json& identity) {
  std::size_t good = 0;  // bytes up to the end of the last whole line
  bool has_header = false;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) break;  // cut off while it was written
    const json line = json::parse(text.begin() + static_cast<std::ptrdiff_t>(begin),
                                  text.begin() + static_cast<std::ptrdiff_t>(end),
                                  nullptr,
                                  /*allow_exceptions=*/false);
    begin = end + 1;
    const auto is_text = [&line](const char* key) {
      return line.contains(key) && line[key].is_string();
    };
    if (!line.is_object() || (has_header && !is_text("step"))) {
      // After a power loss the last line may have its length but not its bytes.
      if (begin == text.size()) break;
      return fail(Errc::kBadFormat,
                  "journal.jsonl is damaged at byte {}; begin again with --restart",
                  good);
    }
    if (!has_header) {
      if (line.value("format", json()) != kFormat || line.value("version", json()) != kVersion)
        return fail(Errc::kBadFormat,
                    "journal.jsonl was not written by this Veneer; begin again with --restart");
      if (const json there = line.value("identity", json::object()); there != identity)
        return fail(Errc::kInvalidOption,
                    "it was begun under other conditions ({}); go on under those, or begin again "
                    "with --restart",
                    difference(there, identity));
      has_header = true;
    } else if (line.contains("value") && is_text("key")) {
      findings_[{line["step"], line["key"]}] = line["value"];
    } else {
      const std::string step = line["step"];
      std::erase_if(findings_, [&step](const auto& each) { return each.first.first == step; });
    }
    good = begin;
  }
  if (good < text.size() && ::ftruncate(fd_.value(), static_cast<off_t>(good)) != 0)
    return fail(Errc::kIo, "cutting off an unfinished line: {}", system_message());
  resumed_ = !findings_.empty();
  if (has_header) return {};
  return append({{"format", kFormat}, {"version", kVersion}, {"identity", identity}});
}

const json* Journal::find(const std::string& step, const std::string& key) const {
  const auto found = findings_.find({step, key});
  return found == findings_.end() ? nullptr : &found->second;
}

Status Journal::append(const json& line) {
  const std::string text = line.dump() + "\n";
  const off_t before = ::lseek(fd_.value(), 0, SEEK_END);
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t count = ::write(fd_.value(), text.data() + written, text.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    written += static_cast<std::size_t>(count);
  }
  if (written == text.size() && ::fdatasync(fd_.value()) == 0) return {};
  const std::string why = system_message();
  // What was written of the line would spoil the next one. Where even that fails, the next start
  // drops it.
  if (before >= 0 && ::ftruncate(fd_.value(), before) != 0) fd_.reset();
  return fail(Errc::kIo,
              "writing {}: {}; make room, then run the same command again: it goes on from here",
              path_.string(),
              why);
}

Status Journal::add(const std::string& step, const std::string& key, json value) {
  VENEER_TRY(append({{"step", step}, {"key", key}, {"value", value}}));
  findings_[{step, key}] = std::move(value);
  return {};
}

Status Journal::forget(const std::string& step) {
  const auto of_step = [&step](const auto& each) { return each.first.first == step; };
  if (std::none_of(findings_.begin(), findings_.end(), of_step)) return {};
  VENEER_TRY(append({{"step", step}, {"forget", true}}));
  std::erase_if(findings_, of_step);
  return {};
}

}  // namespace veneer::calibration
