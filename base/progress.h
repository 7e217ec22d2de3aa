// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace veneer {

/// Where long work says how far it is. advance() may be called from several threads.
class Progress {
 public:
  virtual ~Progress() = default;
  /// Begins a stage of `total` steps. One before it that was not finished is dropped without a word
  /// of success, as by the destructor.
  virtual void start(std::string_view label, std::int64_t total) = 0;
  virtual void advance(std::int64_t steps = 1) = 0;
  /// Ends the stage. `remark` is added to its line (a figure that was reached), may be empty.
  virtual void finish(std::string_view remark = {}) = 0;
};

/// Says nothing.
class SilentProgress final : public Progress {
 public:
  void start(std::string_view, std::int64_t) override {}
  void advance(std::int64_t) override {}
  void finish(std::string_view) override {}
};

/// A bar on standard error where that is a terminal, else a plain line at most every few seconds.
[[nodiscard]] std::unique_ptr<Progress> make_progress();

}  // namespace veneer
