// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming): its own name
class App;
}

namespace veneer::manual {

/// One option or argument of a program, as its own parser knows it.
struct Option {
  std::vector<std::string> names;  ///< "-o", "--output"; empty: told by its place
  std::string value;  ///< what follows it, "TEXT" or "WIDTHxHEIGHT"; empty for a flag. The name of
                      ///< an argument that is told by its place
  std::vector<std::string> choices;   ///< all that the value may be; empty: anything
  std::string limit;                  ///< another condition on the value, for people; may be empty
  std::vector<std::string> excludes;  ///< options that may not stand beside it
  std::string default_value;          ///< may be empty
  std::string text;
  bool required = false;
  bool repeated = false;  ///< may take several values
};

/// How a program, or one of its commands, is called.
struct Usage {
  std::string invocation;  ///< "veneer fit"
  std::string summary;     ///< one line
  std::vector<Option> options;
  std::vector<Usage> commands;  ///< one of which follows
  bool command_required = false;
};

/// What `app` was told to read: options in the order of their declaration, without those of a
/// hidden group, and its sub-commands.
[[nodiscard]] Usage usage_of(const CLI::App& app, std::string invocation);

/// Its letters of ASCII in capitals, as what stands for a value is written.
[[nodiscard]] std::string upper(std::string text);

}  // namespace veneer::manual
