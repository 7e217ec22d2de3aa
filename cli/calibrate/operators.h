// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "calibration/wizard/operator.h"

namespace veneer::cli {

/// A person at a terminal: asked on standard error, answers on standard input.
class TerminalOperator final : public calibration::Operator {
 public:
  [[nodiscard]] Result<calibration::Answer> please(const calibration::Request& request) override;
  [[nodiscard]] Result<calibration::Answer> after_failure(std::string_view step,
                                                          const Error& why) override;
  void say(std::string_view text) override;
};

/// Nobody: what is asked for counts as done, and a failure ends the calibration. For machines whose
/// board, instrument and lens cover need no hands.
class AutomaticOperator final : public calibration::Operator {
 public:
  explicit AutomaticOperator(bool quiet) : quiet_(quiet) {}
  [[nodiscard]] Result<calibration::Answer> please(const calibration::Request& request) override;
  [[nodiscard]] Result<calibration::Answer> after_failure(std::string_view step,
                                                          const Error& why) override;
  void say(std::string_view text) override;

 private:
  bool quiet_;
};

}  // namespace veneer::cli
