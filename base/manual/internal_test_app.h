// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace veneer::manual {

/// A program with every kind of option that ours have.
struct TestApp {
  CLI::App app{"Paint a fence", "fence"};
  bool dry = false;
  std::string colour = "green";
  int coats = 2;
  std::vector<std::string> boards;
  std::string pattern;

  TestApp() {
    app.add_flag("--dry", dry, "Only say what would be done");
    auto* chosen =
        app.add_option("-c,--colour", colour, "Its colour; don't take \\white\nnor .black")
            ->capture_default_str()
            ->check(CLI::IsMember({"green", "red-ish"}));
    app.add_option("--coats", coats, "How many")->check(CLI::Range(1, 9))->excludes(chosen);
    app.add_option("--secret", pattern, "Nobody's business")->group("");
    app.add_option("boards", boards, "Which boards")->required();
    CLI::App* wash = app.add_subcommand("wash", "Clean it first")->fallthrough();
    wash->add_option("--with", pattern, "Soap")->required();
  }
};

}  // namespace veneer::manual
