// SPDX-License-Identifier: Apache-2.0
#include "base/manual/roff.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace veneer::manual {
namespace {

/// Names that are typed are bold, what stands for something is italic.
std::string bold(std::string_view text) { return "\\fB" + escape_roff(text) + "\\fR"; }
std::string italic(std::string_view text) { return "\\fI" + escape_roff(text) + "\\fR"; }

/// Lines stay lines; what begins with blanks is moved in by the macros, not by them.
std::string lines_of(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
    if (!line.empty()) out += (out.empty() ? "" : ".br\n") + escape_roff(line) + "\n";
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

std::string head_of(const Option& option) {
  std::string head;
  for (const std::string& name : option.names) head += (head.empty() ? "" : ", ") + bold(name);
  if (!option.value.empty()) head += (head.empty() ? "" : " ") + italic(option.value);
  if (option.repeated) head += " ...";
  return head;
}

std::string text_of(const Option& option) {
  std::string text = lines_of(option.text);
  std::vector<std::string> remarks;
  if (option.required) remarks.emplace_back("required");
  if (!option.choices.empty())
    remarks.push_back(fmt::format("one of {}", fmt::join(option.choices, ", ")));
  if (!option.limit.empty()) remarks.push_back(option.limit);
  if (!option.excludes.empty())
    remarks.push_back(fmt::format("not with {}", fmt::join(option.excludes, ", ")));
  if (!option.default_value.empty())
    remarks.push_back(fmt::format("default: {}", option.default_value));
  if (!remarks.empty()) text += escape_roff(fmt::format("({})", fmt::join(remarks, "; "))) + "\n";
  return text;
}

std::string options_of(const Usage& usage) {
  std::string text;
  for (const Option& option : usage.options)
    text += ".TP\n" + head_of(option) + "\n" + text_of(option);
  return text;
}

std::string synopsis_of(const Usage& usage) {
  std::string line = bold(usage.invocation);
  if (std::ranges::any_of(usage.options, [](const Option& o) { return !o.names.empty(); }))
    line += " [" + italic("OPTION") + " ...]";
  for (const Option& option : usage.options) {
    if (!option.names.empty()) continue;
    const std::string name = italic(option.value) + (option.repeated ? " ..." : "");
    line += option.required ? " " + name : " [" + name + "]";
  }
  return line + "\n";
}

/// All ways to call it, one a line: with itself, unless a command has to follow, then with each.
void gather_synopses(const Usage& usage, std::vector<std::string>& lines) {
  if (!usage.command_required) lines.push_back(synopsis_of(usage));
  for (const Usage& command : usage.commands) gather_synopses(command, lines);
}

/// A part for each command below, named as it is typed.
std::string commands_of(const Usage& usage) {
  std::string text;
  for (const Usage& command : usage.commands) {
    text += ".SS " + escape_roff(command.invocation) + "\n" + lines_of(command.summary);
    text += options_of(command) + commands_of(command);
  }
  return text;
}

std::string section_text(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find("\n\n"), text.size());
    std::string_view paragraph = text.substr(0, end);
    const std::size_t colon = paragraph.find(": ");
    if (paragraph.starts_with('*') && colon != std::string_view::npos) {
      out += ".TP\n" + bold(paragraph.substr(1, colon - 1)) + "\n" +
             lines_of(paragraph.substr(colon + 2));
    } else {
      out += ".PP\n" + lines_of(paragraph);
    }
    text.remove_prefix(std::min(end + 2, text.size()));
  }
  // The first paragraph follows the title at once.
  return out.starts_with(".PP\n") ? out.substr(4) : out;
}

}  // namespace

std::string escape_roff(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '\\':
        out += "\\(rs";
        break;
      case '-':
        out += "\\-";
        break;  // a hyphen could not be pasted into a shell
      case '\'':
        out += "\\(aq";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '~':
        out += "\\(ti";
        break;
      case '"':
        out += "\\(dq";
        break;
      case '\n':
        out += ' ';
        break;
      default:
        out += c;
    }
  }
  if (out.starts_with('.')) out.insert(0, "\\&");
  return out;
}

std::string to_roff(const Usage& usage, const Page& page) {
  std::string out = fmt::format(".TH {} {} \"\" \"Veneer {}\" \"Veneer\"\n",
                                escape_roff(upper(page.name)),
                                page.section,
                                escape_roff(VENEER_VERSION));
  out += ".SH NAME\n" + escape_roff(page.name) + " \\- " + escape_roff(usage.summary) + "\n";
  out += ".SH SYNOPSIS\n";
  std::vector<std::string> synopses;
  gather_synopses(usage, synopses);
  for (const std::string& line : synopses) out += (&line == &synopses[0] ? "" : ".br\n") + line;
  if (!usage.options.empty()) out += ".SH OPTIONS\n" + options_of(usage);
  if (!usage.commands.empty()) out += ".SH COMMANDS\n" + commands_of(usage);
  for (const auto& [title, text] : page.sections)
    out += ".SH " + escape_roff(upper(title)) + "\n" + section_text(text);
  if (!page.see_also.empty()) {
    out += ".SH SEE ALSO\n";
    for (const std::string& name : page.see_also) {
      const std::size_t parenthesis = std::min(name.find('('), name.size());
      out += bold(name.substr(0, parenthesis)) + escape_roff(name.substr(parenthesis)) +
             (&name == &page.see_also.back() ? "\n" : ",\n");
    }
  }
  return out;
}

}  // namespace veneer::manual
