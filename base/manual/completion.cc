// SPDX-License-Identifier: Apache-2.0
#include "base/manual/completion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>
#include <vector>

namespace veneer::manual {
namespace {

/// Single quotes as bash and zsh read them.
std::string in_quotes(std::string_view text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else {
      out += c == '\n' ? ' ' : c;
    }
  }
  return out + "'";
}

/// The first line of a text, for a shell's list.
std::string first_line(std::string_view text) {
  return std::string(text.substr(0, std::min(text.find('\n'), text.size())));
}

std::string last_word(std::string_view invocation) {
  return std::string(invocation.substr(invocation.rfind(' ') + 1));
}

/// One place where a word is completed: after these commands.
struct Place {
  std::string path;  ///< " track watch"; empty before any command
  const Usage* usage;
  std::vector<const Option*> inherited;  ///< of the commands before it
};

void gather(const Usage& usage,
            const std::string& path,
            const std::vector<const Option*>& inherited,
            std::vector<Place>& places) {
  places.push_back({path, &usage, inherited});
  std::vector<const Option*> handed_on = inherited;
  for (const Option& option : usage.options) {
    if (!option.names.empty()) handed_on.push_back(&option);
  }
  for (const Usage& command : usage.commands)
    gather(command, path + " " + last_word(command.invocation), handed_on, places);
}

std::vector<Place> places_of(const Usage& usage) {
  std::vector<Place> places;
  gather(usage, "", {}, places);
  return places;
}

/// Its own options and those that commands before it left open.
std::vector<const Option*> options_at(const Place& place) {
  std::vector<const Option*> options;
  for (const Option& option : place.usage->options) options.push_back(&option);
  options.insert(options.end(), place.inherited.begin(), place.inherited.end());
  return options;
}

struct Word {
  std::string word;
  std::string text;
};

/// What may come next, each once: commands, names of options, and what an argument may be.
std::vector<Word> words_at(const Place& place) {
  std::vector<Word> words;
  const auto add = [&words](const std::string& word, const std::string& text) {
    if (std::ranges::find(words, word, &Word::word) == words.end())
      words.push_back({word, first_line(text)});
  };
  for (const Usage& command : place.usage->commands)
    add(last_word(command.invocation), command.summary);
  for (const Option* option : options_at(place)) {
    for (const std::string& name : option->names) add(name, option->text);
    if (option->names.empty()) {
      for (const std::string& choice : option->choices) add(choice, option->value);
    }
  }
  return words;
}

/// The branches of a case statement that knows what the path and the word before ask for.
std::string value_cases(const std::vector<Place>& places) {
  std::string text;
  for (const Place& place : places) {
    std::vector<std::string> seen;
    for (const Option* option : options_at(place)) {
      if (option->names.empty() || option->value.empty()) continue;
      std::string patterns;
      for (const std::string& name : option->names) {
        if (std::ranges::find(seen, name) != seen.end()) continue;
        seen.push_back(name);
        patterns += (patterns.empty() ? "" : " | ") + in_quotes(place.path + " " + name);
      }
      if (patterns.empty()) continue;
      text += fmt::format("    {}) values={} ;;\n",
                          patterns,
                          in_quotes(fmt::format("{}", fmt::join(option->choices, " "))));
    }
  }
  return text;
}

std::string path_patterns(const std::vector<Place>& places) {
  std::vector<std::string> paths;
  for (const Place& place : places) {
    if (!place.path.empty()) paths.push_back(in_quotes(place.path));
  }
  return fmt::format("{}", fmt::join(paths, " | "));
}

std::string identifier(std::string_view name) {
  std::string out(name);
  std::ranges::replace(out, '-', '_');
  return out;
}

}  // namespace

std::string bash_completion(const Usage& usage) {
  const std::vector<Place> places = places_of(usage);
  const std::string function = "_" + identifier(usage.invocation);
  std::string text = fmt::format(
      "# bash completion of {0}, made from its own table of commands.\n{1}() {{\n"
      "  local word path='' values='' current=${{COMP_WORDS[COMP_CWORD]}}\n"
      "  COMPREPLY=()\n",
      usage.invocation,
      function);
  if (places.size() > 1) {
    text += fmt::format(
        "  for word in \"${{COMP_WORDS[@]:1:COMP_CWORD-1}}\"; do\n"
        "    case \"$path $word\" in\n    {}) path=\"$path $word\" ;;\n    esac\n  done\n",
        path_patterns(places));
  }
  // Nothing to offer where a value may be anything: then bash offers files.
  text += "  case \"$path ${COMP_WORDS[COMP_CWORD-1]}\" in\n" + value_cases(places) +
          "    *) values=unasked ;;\n  esac\n";
  text +=
      "  if [[ $values != unasked ]]; then\n"
      "    COMPREPLY=($(compgen -W \"$values\" -- \"$current\"))\n    return\n  fi\n"
      "  case \"$path\" in\n";
  for (const Place& place : places) {
    std::vector<std::string> words;
    for (const Word& each : words_at(place)) words.push_back(each.word);
    text += fmt::format("    {}) values={} ;;\n",
                        in_quotes(place.path),
                        in_quotes(fmt::format("{}", fmt::join(words, " "))));
  }
  return text + fmt::format(
                    "  esac\n  COMPREPLY=($(compgen -W \"$values\" -- \"$current\"))\n}}\n"
                    "complete -o bashdefault -o default -F {} {}\n",
                    function,
                    usage.invocation);
}

std::string zsh_completion(const Usage& usage) {
  const std::vector<Place> places = places_of(usage);
  std::string text = fmt::format(
      "#compdef {0}\n# zsh completion of {0}, made from its own table of commands.\n"
      "local word place='' values=unasked\nlocal -a offered\n",
      usage.invocation);
  if (places.size() > 1) {
    text += fmt::format(
        "for word in ${{words[2,CURRENT-1]}}; do\n  case \"$place $word\" in\n"
        "    {}) place=\"$place $word\" ;;\n  esac\ndone\n",
        path_patterns(places));
  }
  text += "case \"$place ${words[CURRENT-1]}\" in\n" + value_cases(places) + "esac\n" +
          "if [[ -z $values ]]; then\n  _files\n  return\nelif [[ $values != unasked ]]; then\n"
          "  compadd -- ${=values}\n  return\nfi\ncase \"$place\" in\n";
  for (const Place& place : places) {
    text += fmt::format("  {}) offered=(\n", in_quotes(place.path));
    for (const Word& each : words_at(place)) {
      std::string word = each.word;
      if (const std::size_t colon = word.find(':'); colon != std::string::npos)
        word.insert(colon, "\\");
      text += "    " + in_quotes(word + ":" + each.text) + "\n";
    }
    text += "  ) ;;\n";
  }
  return text + "esac\n_describe -V word offered\n_files\n";
}

std::string fish_completion(const Usage& usage) {
  const auto fish_quoted = [](std::string_view text) {
    std::string out = "'";
    for (const char c : first_line(text)) {
      if (c == '\'' || c == '\\') out += '\\';
      out += c;
    }
    return out + "'";
  };
  const std::string name = usage.invocation;
  const std::string function = "__" + identifier(name) + "_after";
  std::vector<std::string> paths;
  const std::vector<Place> places = places_of(usage);
  for (const Place& place : places) {
    if (!place.path.empty()) paths.push_back(fish_quoted(place.path));
  }
  std::string text = fmt::format(
      "# fish completion of {0}, made from its own table of commands.\n"
      "function {1} --description 'whether the commands typed so far are these'\n"
      "  set -l place ''\n"
      "  for word in (commandline -opc)[2..-1]\n"
      "    if contains -- \"$place $word\" {2}\n      set place \"$place $word\"\n    end\n  end\n"
      "  test \"$place\" = \"$argv[1]\"\nend\n",
      name,
      function,
      fmt::join(paths, " "));
  for (const Place& place : places) {
    const std::string condition =
        fmt::format("complete -c {} -n \"{} '{}'\"", name, function, place.path);
    for (const Usage& command : place.usage->commands) {
      text += fmt::format("{} -f -a {} -d {}\n",
                          condition,
                          last_word(command.invocation),
                          fish_quoted(command.summary));
    }
    for (const Option* option : options_at(place)) {
      const std::string choices = fmt::format("{}", fmt::join(option->choices, " "));
      if (option->names.empty()) {
        if (!choices.empty()) text += fmt::format("{} -a {}\n", condition, fish_quoted(choices));
        continue;
      }
      text += condition;
      for (const std::string& each : option->names) {
        text += each.starts_with("--") ? " -l " + each.substr(2) : " -s " + each.substr(1);
      }
      if (!option->value.empty())
        text += choices.empty() ? " -r" : " -x -a " + fish_quoted(choices);
      text += " -d " + fish_quoted(option->text) + "\n";
    }
  }
  return text;
}

}  // namespace veneer::manual
