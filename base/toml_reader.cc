// SPDX-License-Identifier: Apache-2.0
#include "base/toml_reader.h"

#define TOML_EXCEPTIONS 0
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "base/files.h"
#include "base/internal_toml_guard.h"

namespace veneer {
namespace {

/// Levenshtein distance, for "did you mean".
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::optional<double> number(const toml::node& node) {
  if (const auto* integer = node.as_integer()) return static_cast<double>(integer->get());
  if (const auto* real = node.as_floating_point(); real != nullptr && std::isfinite(real->get()))
    return real->get();
  return std::nullopt;
}

}  // namespace

struct TomlReader::Node {
  const toml::table* table;  // into the document; nullptr for an absent table
  std::string path;          // "light." for messages
  std::set<std::string, std::less<>> known;
};

struct TomlReader::Document {
  std::string origin;
  std::filesystem::path folder;
  // Shared by those that read it again: a copy of it would not know its lines.
  std::shared_ptr<toml::table> root;
  std::vector<std::shared_ptr<Node>> nodes;
  std::vector<std::string> mistakes;
};

TomlReader::TomlReader(std::shared_ptr<Document> document, std::shared_ptr<Node> node)
    : document_(std::move(document)), node_(std::move(node)) {}

namespace {

/// Puts every value of `changes` in the place of the one in `table`, table by table; a table that
/// is written out in braces replaces the whole one.
void merge(toml::table& table, toml::table&& changes) {
  for (auto&& [key, value] : changes) {
    toml::table* below = table.get_as<toml::table>(key.str());
    const toml::table* change = value.as_table();
    if (below != nullptr && change != nullptr && !change->is_inline()) {
      merge(*below, std::move(*value.as_table()));
    } else {
      table.insert_or_assign(key.str(), std::move(value));
    }
  }
}

}  // namespace

Result<TomlReader> TomlReader::open(const std::filesystem::path& path,
                                    const std::vector<std::string>& overrides) {
  VENEER_ASSIGN(const std::string text, read_text(path));
  VENEER_ASSIGN(TomlReader reader, parse(text, path.string()));
  reader.document_->folder = path.parent_path();
  for (const std::string& line : overrides) {
    if (const auto impossible = find_impossible_toml(line))
      return fail(Errc::kInvalidOption, "reading the setting '{}': {}", line, impossible->what);
    toml::parse_result parsed = toml::parse(line);
    if (!parsed) {
      return fail(
          Errc::kInvalidOption,
          "reading the setting '{}': {}; write it as in the file, such as render.dither=false",
          line,
          std::string(parsed.error().description()));
    }
    merge(*reader.document_->root, std::move(parsed).table());
  }
  return reader;
}

Result<TomlReader> TomlReader::parse(std::string_view text, std::string_view origin) {
  if (const auto impossible = find_impossible_toml(text))
    return fail(Errc::kInvalidOption,
                "{}:{}: {}",
                origin,
                1 + std::ranges::count(text.substr(0, impossible->at), '\n'),
                impossible->what);
  toml::parse_result parsed = toml::parse(text, origin);
  if (!parsed) {
    return fail(Errc::kInvalidOption,
                "{}:{}: {}",
                origin,
                parsed.error().source().begin.line,
                std::string(parsed.error().description()));
  }
  auto document = std::make_shared<Document>();
  document->origin = origin;
  document->root = std::make_shared<toml::table>(std::move(parsed).table());
  auto node = std::make_shared<Node>(Node{document->root.get(), "", {}});
  document->nodes.push_back(node);
  return TomlReader(std::move(document), std::move(node));
}

TomlReader TomlReader::again() const {
  auto document = std::make_shared<Document>();
  document->origin = document_->origin;
  document->folder = document_->folder;
  document->root = document_->root;
  auto node = std::make_shared<Node>(Node{document->root.get(), "", {}});
  document->nodes.push_back(node);
  return TomlReader(std::move(document), std::move(node));
}

namespace {

bool same(const toml::node& a, const toml::node& b) {
  return a.type() == b.type() &&
         a.visit([&b](const auto& value) { return value == static_cast<decltype(value)>(b); });
}

/// Below `path`; a table that one of both lacks counts as empty.
void find_differences(const toml::table& a,
                      const toml::table& b,
                      const std::string& path,
                      std::vector<std::string>& differences) {
  const toml::table empty;
  std::set<std::string> keys;
  for (const toml::table* table : {&a, &b}) {
    for (const auto& [key, value] : *table) keys.emplace(key.str());
  }
  for (const std::string& key : keys) {
    const toml::node* left = a.get(key);
    const toml::node* right = b.get(key);
    const auto is_table = [](const toml::node* node) {
      return node == nullptr || node->is_table();
    };
    if (is_table(left) && is_table(right)) {
      find_differences(left == nullptr ? empty : *left->as_table(),
                       right == nullptr ? empty : *right->as_table(),
                       path + key + '.',
                       differences);
    } else if (left == nullptr || right == nullptr || !same(*left, *right)) {
      differences.push_back(path + key);
    }
  }
}

}  // namespace

std::vector<std::string> TomlReader::differences(const TomlReader& other) const {
  std::vector<std::string> result;
  find_differences(*document_->root, *other.document_->root, "", result);
  return result;
}

bool TomlReader::contains(std::string_view key) const {
  return node_->table != nullptr && node_->table->contains(key);
}

namespace {

/// Registers `key` and hands the node that is there to `convert`, which returns whether it could.
template <class Node, class Convert>
const toml::node* lookup(Node& node, std::string_view key, Convert convert, bool& converted) {
  node.known.emplace(key);
  const toml::node* value = node.table == nullptr ? nullptr : node.table->get(key);
  converted = value == nullptr || convert(*value);
  return value;
}

template <int kSize>
bool read_vector(const toml::node& node, Eigen::Matrix<double, kSize, 1>& value) {
  const toml::array* array = node.as_array();
  if (array == nullptr || array->size() != kSize) return false;
  Eigen::Matrix<double, kSize, 1> result;
  for (int i = 0; i < kSize; ++i) {
    const std::optional<double> element = number(*array->get(static_cast<std::size_t>(i)));
    if (!element) return false;
    result[i] = *element;
  }
  value = result;
  return true;
}

}  // namespace

#define VENEER_TOML_READ(expected, convert)  \
  bool converted = false;                    \
  lookup(*node_, key, (convert), converted); \
  if (!converted) add_error(key, "expected " expected)

void TomlReader::read(std::string_view key, double& value) {
  VENEER_TOML_READ("a finite number", [&](const toml::node& node) {
    const std::optional<double> got = number(node);
    if (got) value = *got;
    return got.has_value();
  });
}

void TomlReader::read(std::string_view key, int& value) {
  VENEER_TOML_READ("a whole number", [&](const toml::node& node) {
    const auto* got = node.as_integer();
    if (got == nullptr || got->get() < std::numeric_limits<int>::min() ||
        got->get() > std::numeric_limits<int>::max()) {
      return false;
    }
    value = static_cast<int>(got->get());
    return true;
  });
}

void TomlReader::read(std::string_view key, std::uint64_t& value) {
  VENEER_TOML_READ("a whole number that is not negative", [&](const toml::node& node) {
    const auto* got = node.as_integer();
    if (got == nullptr || got->get() < 0) return false;
    value = static_cast<std::uint64_t>(got->get());
    return true;
  });
}

void TomlReader::read(std::string_view key, bool& value) {
  VENEER_TOML_READ("true or false", [&](const toml::node& node) {
    const auto* got = node.as_boolean();
    if (got != nullptr) value = got->get();
    return got != nullptr;
  });
}

void TomlReader::read(std::string_view key, std::string& value) {
  VENEER_TOML_READ("a text in quotes", [&](const toml::node& node) {
    const auto* got = node.as_string();
    if (got != nullptr) value = got->get();
    return got != nullptr;
  });
}

void TomlReader::read(std::string_view key, std::filesystem::path& value) {
  std::string text = value.string();
  read(key, text);
  value = text;
}

void TomlReader::read(std::string_view key, Eigen::Vector2d& value) {
  VENEER_TOML_READ("[a, b], two finite numbers",
                   [&](const toml::node& node) { return read_vector<2>(node, value); });
}

void TomlReader::read(std::string_view key, Eigen::Vector3d& value) {
  VENEER_TOML_READ("[a, b, c], three finite numbers",
                   [&](const toml::node& node) { return read_vector<3>(node, value); });
}

void TomlReader::read(std::string_view key, Eigen::Matrix3d& value) {
  VENEER_TOML_READ("three rows of three finite numbers", [&](const toml::node& node) {
    const toml::array* rows = node.as_array();
    if (rows == nullptr || rows->size() != 3) return false;
    Eigen::Matrix3d result;
    for (int i = 0; i < 3; ++i) {
      Eigen::Vector3d row;
      if (!read_vector<3>(*rows->get(static_cast<std::size_t>(i)), row)) return false;
      result.row(i) = row;
    }
    value = result;
    return true;
  });
}

void TomlReader::read(std::string_view key, std::vector<double>& value) {
  VENEER_TOML_READ("a list of finite numbers", [&](const toml::node& node) {
    const toml::array* array = node.as_array();
    if (array == nullptr) return false;
    std::vector<double> result;
    for (const toml::node& element : *array) {
      const std::optional<double> got = number(element);
      if (!got) return false;
      result.push_back(*got);
    }
    value = std::move(result);
    return true;
  });
}

void TomlReader::read(std::string_view key, std::vector<Eigen::Vector2d>& value) {
  VENEER_TOML_READ("a list of [a, b], each two finite numbers", [&](const toml::node& node) {
    const toml::array* array = node.as_array();
    if (array == nullptr) return false;
    std::vector<Eigen::Vector2d> result(array->size());
    for (std::size_t i = 0; i < result.size(); ++i) {
      if (!read_vector<2>(*array->get(i), result[i])) return false;
    }
    value = std::move(result);
    return true;
  });
}

void TomlReader::read(std::string_view key, std::vector<int>& value) {
  VENEER_TOML_READ("a list of whole numbers", [&](const toml::node& node) {
    const toml::array* array = node.as_array();
    if (array == nullptr) return false;
    std::vector<int> result;
    for (const toml::node& element : *array) {
      const std::optional<std::int64_t> got = element.value_exact<std::int64_t>();
      if (!got || !std::in_range<int>(*got)) return false;
      result.push_back(static_cast<int>(*got));
    }
    value = std::move(result);
    return true;
  });
}

void TomlReader::read(std::string_view key, std::vector<std::string>& value) {
  VENEER_TOML_READ("a list of texts in quotes", [&](const toml::node& node) {
    const toml::array* array = node.as_array();
    if (array == nullptr) return false;
    std::vector<std::string> result;
    for (const toml::node& element : *array) {
      const auto* got = element.as_string();
      if (got == nullptr) return false;
      result.push_back(got->get());
    }
    value = std::move(result);
    return true;
  });
}

#undef VENEER_TOML_READ

TomlReader TomlReader::table(std::string_view key) {
  bool converted = false;
  const toml::node* value = lookup(
      *node_, key, [](const toml::node& node) { return node.is_table(); }, converted);
  if (!converted) add_error(key, "expected a table");
  auto node = std::make_shared<Node>(Node{
      value == nullptr ? nullptr : value->as_table(), node_->path + std::string(key) + ".", {}});
  document_->nodes.push_back(node);
  return {document_, std::move(node)};
}

std::vector<TomlReader> TomlReader::tables(std::string_view key) {
  bool converted = false;
  const toml::node* value = lookup(
      *node_, key, [](const toml::node& node) { return node.is_array_of_tables(); }, converted);
  if (!converted) add_error(key, "expected tables, written [[...]]");
  std::vector<TomlReader> readers;
  if (value == nullptr || !converted) return readers;
  for (const toml::node& element : *value->as_array()) {
    auto node = std::make_shared<Node>(
        Node{element.as_table(), fmt::format("{}{}[{}].", node_->path, key, readers.size()), {}});
    document_->nodes.push_back(node);
    readers.push_back(TomlReader(document_, std::move(node)));
  }
  return readers;
}

void TomlReader::ignore_the_rest() {
  if (node_->table == nullptr) return;
  for (const auto& [key, value] : *node_->table) node_->known.emplace(key.str());
}

void TomlReader::add_error(std::string_view key, std::string_view text) {
  const toml::node* value = node_->table == nullptr ? nullptr : node_->table->get(key);
  const auto line = value == nullptr ? 0U : value->source().begin.line;
  document_->mistakes.push_back(
      line == 0 ? fmt::format("{}: {}{}: {}", document_->origin, node_->path, key, text)
                : fmt::format("{}:{}: {}{}: {}", document_->origin, line, node_->path, key, text));
}

void TomlReader::add_missing(std::string_view key) {
  node_->known.emplace(key);
  add_error(key, "this key is missing");
}

std::filesystem::path TomlReader::folder() const { return document_->folder; }

Status TomlReader::finish() {
  std::vector<std::string> mistakes = document_->mistakes;
  for (const std::shared_ptr<Node>& node : document_->nodes) {
    if (node->table == nullptr) continue;
    for (const auto& [key, value] : *node->table) {
      if (node->known.contains(key.str())) continue;
      const auto nearest =
          std::ranges::min_element(node->known, {}, [name = key.str()](const std::string& known) {
            return edit_distance(known, name);
          });
      const std::string hint =
          nearest == node->known.end() ? "" : fmt::format("; did you mean \"{}\"?", *nearest);
      mistakes.push_back(fmt::format("{}:{}: {}{}: unknown key{}",
                                     document_->origin,
                                     value.source().begin.line,
                                     node->path,
                                     std::string(key.str()),
                                     hint));
    }
  }
  if (mistakes.empty()) return {};
  return fail(Errc::kInvalidOption, "{}", fmt::join(mistakes, "\n"));
}

}  // namespace veneer
