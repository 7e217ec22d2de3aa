// SPDX-License-Identifier: Apache-2.0
#include "base/journal.h"

#include <algorithm>
#include <system_error>

namespace veneer {
namespace {

using nlohmann::json;

constexpr int kVersion = 1;

/// "bench: "a.toml" then, "b.toml" now" for the first thing in which they differ.
std::string difference(const json& there, const json& here) {
  for (const auto& [key, value] : here.items()) {
    const json old = there.value(key, json());
    if (old != value) return fmt::format("{}: {} then, {} now", key, old.dump(), value.dump());
  }
  return "it knows of something that this one does not";
}

}  // namespace

Result<Journal> Journal::open(const JournalKind& kind,
                              const std::filesystem::path& folder,
                              const json& identity,
                              bool restart) {
  const std::filesystem::path path = folder / "journal.jsonl";
  const std::string doing = fmt::format("{} {}", kind.doing, folder.string());
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return fail(Errc::kIo, "{}: {}", doing, error.message());
  auto lines = LockedLines::open(path);
  if (!lines && lines.error().code == Errc::kUnavailable)
    return fail(Errc::kUnavailable, "{}: {}", doing, kind.busy);
  if (!lines) return fail_while(doing, lines.error());
  if (restart) VENEER_TRY(lines->clear());
  Journal journal(std::move(*lines));
  if (const Status taken = journal.take(kind, identity); !taken)
    return fail_while(doing, taken.error());
  return journal;
}

Status Journal::take(const JournalKind& kind, const json& identity) {
  bool has_header = false;
  const Status taken = lines_.take([&](std::string_view text) -> Result<bool> {
    const json line = json::parse(text, nullptr, /*allow_exceptions=*/false);
    const auto is_text = [&line](const char* key) {
      return line.contains(key) && line[key].is_string();
    };
    if (!line.is_object() || (has_header && !is_text("step"))) return false;
    if (!has_header) {
      if (line.value("format", json()) != kind.format || line.value("version", json()) != kVersion)
        return fail(Errc::kBadFormat, "it was not written by this Veneer");
      if (const json there = line.value("identity", json::object()); there != identity)
        return fail(Errc::kInvalidOption,
                    "it was begun under other conditions ({}); go on under those, or {}",
                    difference(there, identity),
                    kind.restart);
      has_header = true;
    } else if (line.contains("value") && is_text("key")) {
      findings_[{line["step"], line["key"]}] = line["value"];
    } else {
      const std::string step = line["step"];
      std::erase_if(findings_, [&step](const auto& each) { return each.first.first == step; });
    }
    return true;
  });
  if (!taken && taken.error().code == Errc::kBadFormat)
    return fail(Errc::kBadFormat, "journal.jsonl: {}; {}", taken.error().what, kind.restart);
  VENEER_TRY(taken);
  resumed_ = !findings_.empty();
  if (has_header) return {};
  return append({{"format", kind.format}, {"version", kVersion}, {"identity", identity}});
}

const json* Journal::find(const std::string& step, const std::string& key) const {
  const auto found = findings_.find({step, key});
  return found == findings_.end() ? nullptr : &found->second;
}

Status Journal::append(const json& line) { return lines_.append(line.dump()); }

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

}  // namespace veneer
