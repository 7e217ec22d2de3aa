// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"

namespace veneer::btf::ubo2003 {

/// The files of a folder and what lies under it, or of a zip archive. bytes() may be called from
/// several threads.
class Pictures {
 public:
  /// Errors: kNotFound, kIo (a folder that cannot be read), kBadFormat (no zip archive).
  [[nodiscard]] static Result<Pictures> open(const std::filesystem::path& source);
  /// With their folders.
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
  /// What a file holds. Errors: kIo, kBadFormat (damaged, or it claims an absurd size).
  [[nodiscard]] Result<std::string> bytes(std::size_t index) const;

 private:
  struct Zip;
  std::filesystem::path source_;
  std::vector<std::string> names_;
  std::shared_ptr<Zip> zip_;  // none for a folder
};

}  // namespace veneer::btf::ubo2003
