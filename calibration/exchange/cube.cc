// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/cube.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "base/files.h"
#include "calibration/exchange/internal_lcms.h"

namespace veneer::calibration {
namespace {

constexpr int kMost1d = 65536;
constexpr int kMost3d = 129;
/// Of a file: a grid of 129 nodes with thirteen bytes a number has 84 MB.
constexpr std::size_t kLargestFile = std::size_t{128} << 20U;

std::size_t count_of(CubeTable::Kind kind, int size) {
  const auto n = static_cast<std::size_t>(size);
  return kind == CubeTable::Kind::k1d ? n : n * n * n;
}

bool is_good_title(std::string_view title) {
  return std::ranges::all_of(title, [](char c) {
    return c != '"' && (static_cast<unsigned char>(c) >= 0x20 && c != 0x7F);
  });
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t at = 0; at < line.size();) {
    const std::size_t begin = line.find_first_not_of(" \t", at);
    if (begin == std::string_view::npos) break;
    const std::size_t end = std::min(line.find_first_of(" \t", begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    at = end;
  }
  return words;
}

template <class T>
std::optional<T> number_from(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

std::optional<Eigen::Vector3d> vector_from(std::span<const std::string_view> words) {
  if (words.size() != 3) return std::nullopt;
  Eigen::Vector3d v;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto value = number_from<double>(words[i]);
    if (!value || !std::isfinite(*value)) return std::nullopt;
    v(static_cast<Eigen::Index>(i)) = *value;
  }
  return v;
}

/// Reads line by line; the error says what of the line is wrong.
class CubeParser {
 public:
  Result<void> take(std::string_view line);
  [[nodiscard]] bool has_size() const { return table_.size > 0; }
  CubeTable& table() { return table_; }

 private:
  Status take_size(CubeTable::Kind kind, std::span<const std::string_view> words);
  Status take_domain(Eigen::Vector3d& domain, std::span<const std::string_view> words);
  Status take_input_range(std::span<const std::string_view> words);
  CubeTable table_;
};

Status CubeParser::take_size(CubeTable::Kind kind, std::span<const std::string_view> words) {
  const int most = kind == CubeTable::Kind::k1d ? kMost1d : kMost3d;
  const auto size = words.size() == 2 ? number_from<int>(words[1]) : std::nullopt;
  if (has_size()) return fail(Errc::kBadFormat, "it has a second size; one table a file is read");
  if (!size || *size < 2 || *size > most)
    return fail(Errc::kBadFormat, "the size is not a number from 2 to {}", most);
  table_.kind = kind;
  table_.size = *size;
  return {};
}

Status CubeParser::take_domain(Eigen::Vector3d& domain, std::span<const std::string_view> words) {
  const auto value = vector_from(words.subspan(1));
  if (!value) return fail(Errc::kBadFormat, "three finite numbers are needed after {}", words[0]);
  domain = *value;
  return {};
}

/// As Resolve writes it: one range for all channels.
Status CubeParser::take_input_range(std::span<const std::string_view> words) {
  const auto low = words.size() == 3 ? number_from<double>(words[1]) : std::nullopt;
  const auto high = words.size() == 3 ? number_from<double>(words[2]) : std::nullopt;
  if (!low || !high || !std::isfinite(*low) || !std::isfinite(*high))
    return fail(Errc::kBadFormat, "two finite numbers are needed after {}", words[0]);
  table_.domain_min.setConstant(*low);
  table_.domain_max.setConstant(*high);
  return {};
}

Result<void> CubeParser::take(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  const std::vector<std::string_view> words = words_of(line);
  if (words.empty() || words[0].starts_with('#')) return {};
  const std::string_view keyword = words[0];
  const char first = keyword[0];
  if ((first >= 'A' && first <= 'Z') || (first >= 'a' && first <= 'z')) {
    if (!table_.values.empty())
      return fail(Errc::kBadFormat, "{} comes after the values", printable(keyword, 40));
    if (keyword == "LUT_1D_SIZE") return take_size(CubeTable::Kind::k1d, words);
    if (keyword == "LUT_3D_SIZE") return take_size(CubeTable::Kind::k3d, words);
    if (keyword == "DOMAIN_MIN") return take_domain(table_.domain_min, words);
    if (keyword == "DOMAIN_MAX") return take_domain(table_.domain_max, words);
    if (keyword == "LUT_1D_INPUT_RANGE" || keyword == "LUT_3D_INPUT_RANGE")
      return take_input_range(words);
    if (keyword == "TITLE") {
      const std::size_t begin = line.find('"');
      const std::size_t end = line.rfind('"');
      if (begin == std::string_view::npos || end == begin)
        return fail(Errc::kBadFormat, "the title is not in quotes");
      table_.title = line.substr(begin + 1, end - begin - 1);
      if (!is_good_title(table_.title))
        return fail(Errc::kBadFormat, "the title holds what no text has");
      return {};
    }
    return fail(Errc::kBadFormat, "the keyword {} is not known", printable(keyword, 40));
  }
  if (!has_size()) return fail(Errc::kBadFormat, "values come before LUT_1D_SIZE or LUT_3D_SIZE");
  if (table_.values.size() == count_of(table_.kind, table_.size))
    return fail(Errc::kBadFormat, "there are more values than the size says");
  const auto value = vector_from(words);
  if (!value)
    return fail(Errc::kBadFormat, "\"{}\" is not three finite numbers", printable(line, 60));
  table_.values.push_back(*value);
  return {};
}

/// Node and part of the way to the next of a value in [0, 1] on `size` nodes.
std::pair<int, double> place_of(double value, int size) {
  const double scaled = std::clamp(value, 0.0, 1.0) * (size - 1);
  const int node = std::min(static_cast<int>(scaled), size - 2);
  return {node, scaled - node};
}

}  // namespace

Status CubeTable::check() const {
  const int most = kind == Kind::k1d ? kMost1d : kMost3d;
  if (size < 2 || size > most)
    return fail(Errc::kBadFormat, "a table has 2 to {} nodes, not {}", most, size);
  if (values.size() != count_of(kind, size))
    return fail(Errc::kBadFormat,
                "a table of size {} has {} values, not {}",
                size,
                count_of(kind, size),
                values.size());
  if (!std::ranges::all_of(values, [](const Eigen::Vector3d& v) { return v.allFinite(); }))
    return fail(Errc::kBadFormat, "a value of the table is not finite");
  if (!domain_min.allFinite() || !domain_max.allFinite() ||
      !((domain_max - domain_min).array() > 0).all())
    return fail(Errc::kBadFormat, "the domain of the table is empty or not finite");
  if (!is_good_title(title))
    return fail(Errc::kBadFormat, "the title of the table holds quotes or line ends");
  return {};
}

Eigen::Vector3d CubeTable::operator()(const Eigen::Vector3d& rgb) const {
  if (!(rgb.array() == rgb.array()).all()) return Eigen::Vector3d::Constant(std::nan(""));
  const Eigen::Array3d unit = (rgb - domain_min).array() / (domain_max - domain_min).array();
  const auto node = [this](int i) -> const Eigen::Vector3d& {
    return values[static_cast<std::size_t>(i)];
  };
  Eigen::Vector3d result = Eigen::Vector3d::Zero();
  if (kind == Kind::k1d) {
    for (int c = 0; c < 3; ++c) {
      const auto [i, part] = place_of(unit(c), size);
      result(c) = (1 - part) * node(i)(c) + part * node(i + 1)(c);
    }
    return result;
  }
  const auto [r, part_r] = place_of(unit(0), size);
  const auto [g, part_g] = place_of(unit(1), size);
  const auto [b, part_b] = place_of(unit(2), size);
  for (int corner = 0; corner < 8; ++corner) {
    const int up_r = corner & 1;
    const int up_g = corner >> 1 & 1;
    const int up_b = corner >> 2;
    const double weight = (up_r != 0 ? part_r : 1 - part_r) * (up_g != 0 ? part_g : 1 - part_g) *
                          (up_b != 0 ? part_b : 1 - part_b);
    result += weight * node(((b + up_b) * size + g + up_g) * size + r + up_r);
  }
  return result;
}

CubeTable CubeTable::sampled(
    int size, const std::function<Eigen::Vector3d(const Eigen::Vector3d& rgb)>& function) {
  VENEER_CHECK(size >= 2 && size <= kMost3d);
  CubeTable table;
  table.size = size;
  table.values.reserve(count_of(Kind::k3d, size));
  for (int b = 0; b < size; ++b)
    for (int g = 0; g < size; ++g)
      for (int r = 0; r < size; ++r)
        table.values.push_back(function(Eigen::Vector3d(r, g, b) / (size - 1)));
  return table;
}

Result<CubeTable> parse_cube(std::string_view text, std::string_view origin) {
  if (text.size() > kLargestFile)
    return fail(Errc::kBadFormat,
                "reading {}: it has {} bytes, more than any table; see that it is the right file",
                origin,
                text.size());
  CubeParser parser;
  int number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    ++number;
    if (auto taken = parser.take(text.substr(at, end - at)); !taken)
      return fail(Errc::kBadFormat,
                  "reading {}, line {}: {}; export it again as .cube",
                  origin,
                  number,
                  taken.error().what);
    at = end + 1;
  }
  if (!parser.has_size())
    return fail(Errc::kBadFormat,
                "reading {}: it has neither LUT_1D_SIZE nor LUT_3D_SIZE; see that it is a .cube",
                origin);
  if (const Status good = parser.table().check(); !good)
    return fail(
        Errc::kBadFormat, "reading {}: {}; export it again as .cube", origin, good.error().what);
  return std::move(parser.table());
}

Result<CubeTable> read_cube(const std::filesystem::path& path) {
  VENEER_ASSIGN(const std::string text, read_text(path));
  return parse_cube(text, path.string());
}

Result<std::string> cube_text(const CubeTable& table) {
  if (const Status good = table.check(); !good) return fail_while("writing .cube", good.error());
  std::string text;
  const auto line = [&](std::string_view keyword, const Eigen::Vector3d& v) {
    fmt::format_to(std::back_inserter(text),
                   "{}{}{:.9g} {:.9g} {:.9g}\n",
                   keyword,
                   keyword.empty() ? "" : " ",
                   v.x(),
                   v.y(),
                   v.z());
  };
  if (!table.title.empty()) text += fmt::format("TITLE \"{}\"\n", table.title);
  text += fmt::format(
      "{} {}\n", table.kind == CubeTable::Kind::k1d ? "LUT_1D_SIZE" : "LUT_3D_SIZE", table.size);
  line("DOMAIN_MIN", table.domain_min);
  line("DOMAIN_MAX", table.domain_max);
  for (const Eigen::Vector3d& value : table.values) line("", value);
  return text;
}

Status write_cube(const std::filesystem::path& path, const CubeTable& table) {
  VENEER_ASSIGN(const std::string text, cube_text(table));
  return write_text(path, text);
}

}  // namespace veneer::calibration
