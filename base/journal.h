// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "base/locked_lines.h"
#include "base/result.h"

namespace veneer {

/// What a journal is of, and how its errors speak.
struct JournalKind {
  std::string_view format;   ///< in its first line
  std::string_view doing;    ///< "opening the session"; the folder follows
  std::string_view busy;     ///< who has it open and what to do about it
  std::string_view restart;  ///< how to begin anew: "begin again with --restart"
};

/// What a session has found out so far, on disk: a line of JSON a finding, in the order in which
/// they came, each on the disk before anybody goes on. A session that was killed, or whose machine
/// lost its power, is resumed by running it again: what the journal has is not measured anew. One
/// thread.
class Journal {
 public:
  /// Opens `folder`/journal.jsonl or begins it. A line that was cut off at its end, as by a power
  /// loss, is dropped.
  /// @param identity  what must be the same for the findings to hold: devices, inputs, options.
  /// @param restart  forgets all that is there, once no other program has it open.
  /// Errors: kBadFormat (a journal of another Veneer, a damaged one), kInvalidOption (of another
  /// identity, says what differs), kUnavailable (another program has it open), kIo.
  [[nodiscard]] static Result<Journal> open(const JournalKind& kind,
                                            const std::filesystem::path& folder,
                                            const nlohmann::json& identity,
                                            bool restart = false);

  /// Nothing where it is not known.
  [[nodiscard]] const nlohmann::json* find(const std::string& step, const std::string& key) const;
  /// Written and flushed to the disk on return; on an error the finding is not known.
  /// Errors: kIo (disk full, for example).
  [[nodiscard]] Status add(const std::string& step, const std::string& key, nlohmann::json value);
  /// A step's findings hold no longer. Errors: kIo.
  [[nodiscard]] Status forget(const std::string& step);
  [[nodiscard]] std::size_t size() const { return findings_.size(); }
  /// Whether there were findings when it was opened.
  [[nodiscard]] bool resumed() const { return resumed_; }

 private:
  explicit Journal(LockedLines lines) : lines_(std::move(lines)) {}
  [[nodiscard]] Status append(const nlohmann::json& line);
  [[nodiscard]] Status take(const JournalKind& kind, const nlohmann::json& identity);

  LockedLines lines_;
  std::map<std::pair<std::string, std::string>, nlohmann::json> findings_;
  bool resumed_ = false;
};

}  // namespace veneer
