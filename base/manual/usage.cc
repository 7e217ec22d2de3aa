// SPDX-License-Identifier: Apache-2.0
#include "base/manual/usage.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <string_view>

namespace veneer::manual {
namespace {

/// What the checks of an option say of its value: "TEXT:{a,b}" or "INT:INT in [1 - 9]".
void read_checks(std::string_view checks, Option& option) {
  if (checks.starts_with('{') && checks.ends_with('}')) {
    option.choices = CLI::detail::split(std::string(checks.substr(1, checks.size() - 2)), ',');
  } else {
    option.limit = checks;
  }
}

Option option_of(const CLI::Option& declared) {
  Option option;
  for (const std::string& name : declared.get_snames()) option.names.push_back("-" + name);
  for (const std::string& name : declared.get_lnames()) option.names.push_back("--" + name);
  const bool takes_value = declared.get_items_expected_max() > 0;
  if (takes_value) {
    const std::string type = declared.get_type_name();
    const std::size_t colon = type.find(':');
    option.value = type.substr(0, colon);
    if (colon != std::string::npos) read_checks(std::string_view(type).substr(colon + 1), option);
    option.default_value = declared.get_default_str();
    option.repeated = declared.get_items_expected_max() == CLI::detail::expected_max_vector_size;
  }
  if (option.names.empty()) option.value = upper(declared.get_single_name());
  option.text = declared.get_description();
  option.required = declared.get_required();
  for (const CLI::Option* other : declared.get_excludes())
    option.excludes.push_back(other->get_name());
  std::ranges::sort(option.excludes);
  return option;
}

}  // namespace

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

Usage usage_of(const CLI::App& app, std::string invocation) {
  Usage usage;
  usage.summary = app.get_description();
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_group().empty()) usage.options.push_back(option_of(*option));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App* each) {
         return !each->get_name().empty() && !each->get_group().empty();
       })) {
    usage.commands.push_back(usage_of(*command, invocation + " " + command->get_name()));
  }
  usage.command_required = app.get_require_subcommand_min() > 0;
  usage.invocation = std::move(invocation);
  return usage;
}

}  // namespace veneer::manual
