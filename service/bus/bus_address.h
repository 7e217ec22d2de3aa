// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"

namespace veneer::service {

/// Which message bus: "system", "session", or a D-Bus address such as "unix:path=/run/bus".
class BusAddress {
 public:
  /// The bus of the machine.
  BusAddress() : text_("system") {}
  /// Errors: kInvalidOption.
  [[nodiscard]] static Result<BusAddress> parse(std::string_view text);
  [[nodiscard]] const std::string& text() const { return text_; }
  /// For texts: "the system bus".
  [[nodiscard]] std::string name() const;

 private:
  explicit BusAddress(std::string text) : text_(std::move(text)) {}
  std::string text_;
};

}  // namespace veneer::service
