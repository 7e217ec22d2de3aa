// SPDX-License-Identifier: Apache-2.0
#include "cli/capture/terminal_hands.h"

#include <cstdio>
#include <iostream>
#include <string>

namespace veneer::cli {

Status TerminalHands::please(const capture::HandRequest& request) {
  while (true) {
    fmt::print(stderr, "\n  {}\n  [Enter: done; q: stop, go on later] ", request.text);
    std::string line;
    // Where nobody is there to answer any more, nothing can be done by hand either.
    if (!std::getline(std::cin, line) || line == "q" || line == "Q")
      return fail(Errc::kCancelled, "stopped at: {}", request.text);
    if (line.empty()) return {};
    fmt::print(stderr, "  Please press Enter alone, or q and Enter.\n");
  }
}

void TerminalHands::say(std::string_view text) { fmt::print(stderr, "  {}\n", text); }

}  // namespace veneer::cli
