// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace veneer {

/// Reads a TOML file into plain structs and refuses what it does not know.
///
/// read() leaves the default where a key is absent, require() does not. Mistakes (a missing or
/// unknown key, a wrong type) are collected and returned by finish(), with file, line and, for an
/// unknown key, the nearest known one. Keys are the names of the fields.
///
///     VENEER_ASSIGN(TomlReader toml, TomlReader::open(path));
///     toml.read("frames", config.frames);
///     TomlReader light = toml.table("light");
///     light.require("direction", config.light.direction);
///     VENEER_TRY(toml.finish());
class TomlReader {
 public:
  /// @param overrides  "key = value" lines in TOML's own syntax ("render.dither = false") that
  ///                   replace what the file says.
  [[nodiscard]] static Result<TomlReader> open(const std::filesystem::path& path,
                                               const std::vector<std::string>& overrides = {});
  /// @param origin  what error messages call the text.
  [[nodiscard]] static Result<TomlReader> parse(std::string_view text, std::string_view origin);

  /// A reader of the same text, as it was read then, of which nothing has been asked yet: for what
  /// is opened again while somebody edits the file.
  [[nodiscard]] TomlReader again() const;

  /// The keys whose values are not those of `other`, one that only one of both has included, as
  /// "tracker.driver", sorted. Values are compared as they are written; whole arrays at once.
  [[nodiscard]] std::vector<std::string> differences(const TomlReader& other) const;

  void read(std::string_view key, double& value);
  void read(std::string_view key, int& value);
  void read(std::string_view key, std::uint64_t& value);
  void read(std::string_view key, bool& value);
  void read(std::string_view key, std::string& value);
  void read(std::string_view key, std::filesystem::path& value);  ///< as written
  void read(std::string_view key, Eigen::Vector2d& value);
  void read(std::string_view key, Eigen::Vector3d& value);
  void read(std::string_view key, Eigen::Matrix3d& value);  ///< three rows of three
  void read(std::string_view key, std::vector<double>& value);
  void read(std::string_view key, std::vector<int>& value);
  void read(std::string_view key, std::vector<Eigen::Vector2d>& value);
  void read(std::string_view key, std::vector<std::string>& value);
  template <class T>
  void require(std::string_view key, T& value) {
    if (contains(key)) {
      read(key, value);
    } else {
      add_missing(key);
    }
  }
  [[nodiscard]] bool contains(std::string_view key) const;
  /// The sub-table `key`; an absent one reads as empty.
  [[nodiscard]] TomlReader table(std::string_view key);
  /// The tables of an array of tables `[[key]]`; none where it is absent.
  [[nodiscard]] std::vector<TomlReader> tables(std::string_view key);
  /// Takes what has not been asked for in this table as known: it is the business of another
  /// program that reads the same file. Tables below it that were asked for are still checked.
  void ignore_the_rest();
  /// Records a mistake at `key`, for values out of range: "file:line: key: text".
  void add_error(std::string_view key, std::string_view text);
  /// The folder of the file, to which relative paths in it refer.
  [[nodiscard]] std::filesystem::path folder() const;
  /// All mistakes of this file so far, unknown keys of every table included. Errors:
  /// kInvalidOption.
  [[nodiscard]] Status finish();

 private:
  struct Document;
  struct Node;
  TomlReader(std::shared_ptr<Document> document, std::shared_ptr<Node> node);
  void add_missing(std::string_view key);
  std::shared_ptr<Document>
      document_;  // shared by the readers of one file: mistakes gather in one place
  std::shared_ptr<Node> node_;
};

}  // namespace veneer
