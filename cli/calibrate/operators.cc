// SPDX-License-Identifier: Apache-2.0
#include "cli/calibrate/operators.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <iostream>
#include <optional>

namespace veneer::cli {
namespace {

using calibration::Answer;

/// The answer that a line stands for; nothing for one that stands for none.
std::optional<Answer> answer_of(std::string line, Answer to_nothing) {
  std::erase_if(line, [](unsigned char c) { return std::isspace(c) != 0; });
  std::ranges::transform(
      line, line.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (line.empty()) return to_nothing;
  if (line == "a" || line == "again") return Answer::kAgain;
  if (line == "s" || line == "skip") return Answer::kSkip;
  if (line == "b" || line == "back") return Answer::kBack;
  if (line == "q" || line == "quit") return Answer::kQuit;
  return std::nullopt;
}

Answer ask(std::string_view choices, Answer to_nothing) {
  while (true) {
    fmt::print(stderr, "  [{}] ", choices);
    std::string line;
    // Nobody is there to answer any more: the session is kept.
    if (!std::getline(std::cin, line)) return Answer::kQuit;
    if (const auto answer = answer_of(line, to_nothing)) return *answer;
    fmt::print(stderr, "  Please type one of the letters, or Enter alone.\n");
  }
}

}  // namespace

Result<Answer> TerminalOperator::please(const calibration::Request& request) {
  fmt::print(stderr, "\n  {}\n", request.text);
  return ask("Enter: done; a: this step again; s: skip; b: the step before; q: stop, go on later",
             Answer::kDone);
}

Result<Answer> TerminalOperator::after_failure(std::string_view /*step*/, const Error& why) {
  fmt::print(stderr, "\n  That did not work. {}.\n", why.what);
  return ask("Enter or a: again; s: go on without it; b: the step before; q: stop, go on later",
             Answer::kAgain);
}

void TerminalOperator::say(std::string_view text) { fmt::print(stderr, "{}\n", text); }

Result<Answer> AutomaticOperator::please(const calibration::Request& /*request*/) {
  return Answer::kDone;
}

Result<Answer> AutomaticOperator::after_failure(std::string_view /*step*/, const Error& /*why*/) {
  return Answer::kQuit;
}

void AutomaticOperator::say(std::string_view text) {
  if (!quiet_) fmt::print(stderr, "{}\n", text);
}

}  // namespace veneer::cli
