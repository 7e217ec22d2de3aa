// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "capture/hands.h"

namespace veneer::cli {

/// A person at a terminal does what is asked for: told on standard error, done with Enter.
class TerminalHands final : public capture::Hands {
 public:
  [[nodiscard]] Status please(const capture::HandRequest& request) override;
  void say(std::string_view text) override;
};

}  // namespace veneer::cli
