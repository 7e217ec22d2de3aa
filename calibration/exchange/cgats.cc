// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/cgats.h"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "base/files.h"
#include "calibration/exchange/internal_lcms.h"

namespace veneer::calibration {
namespace {

/// Enough for the 36 to 401 bands of spectral files, which name each a column.
constexpr int kMostFields = 512;

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

/// A word of another: `text` holds `word` at `at`, whatever the case.
bool is_at(std::string_view text, std::size_t at, std::string_view word) {
  if (text.size() - at < word.size()) return false;
  return std::equal(
      word.begin(), word.end(), text.begin() + static_cast<std::ptrdiff_t>(at), [](char a, char b) {
        return lower(a) == lower(b);
      });
}

/// The number that a size keyword at `at` declares; empty where it is not a plain decimal one.
std::optional<int> declared(std::string_view text, std::size_t at) {
  while (at < text.size() && (text[at] == ' ' || text[at] == '\t')) ++at;
  if (at < text.size() && text[at] == '"') ++at;
  int value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + at, end, value);
  const bool ends = stop == end || is_space(*stop) || *stop == '"';
  if (error != std::errc{} || !ends || value < 0) return std::nullopt;
  return value;
}

/// Refuses what LittleCMS 2.14 does not withstand: it allocates what a table declares before it
/// looks at the rest, with a product that overflows, and it opens files that a table names.
Status check_text(std::string_view text, std::string_view origin) {
  if (text.empty())
    return fail(Errc::kBadFormat, "reading {}: it is empty; export it again", origin);
  if (text.size() > kLargestCgats)
    return fail(Errc::kBadFormat,
                "reading {}: it has {} bytes, a table of colours has at most {}; see that it is "
                "the right file",
                origin,
                text.size(),
                kLargestCgats);
  if (text.find('\0') != std::string_view::npos)
    return fail(Errc::kBadFormat,
                "reading {}: it holds zero bytes, so that it is no text; see that it is the right "
                "file",
                origin);
  constexpr std::string_view kSets = "NUMBER_OF_SETS";
  constexpr std::string_view kFields = "NUMBER_OF_FIELDS";
  int sets = 0;
  int fields = 0;
  bool is_whole = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (text[at] == '.' && is_at(text, at, ".include"))
      return fail(Errc::kBadFormat,
                  "reading {}: it includes another file, which no table of readings does; export "
                  "it again",
                  origin);
    constexpr std::string_view kEnd = "END_DATA";
    if (lower(text[at]) == 'e' && is_at(text, at, kEnd)) {
      const std::size_t behind = at + kEnd.size();
      is_whole = is_whole || behind == text.size() || text[behind] != '_';
    }
    if (lower(text[at]) != 'n') continue;
    const bool is_sets = is_at(text, at, kSets);
    if (!is_sets && !is_at(text, at, kFields)) continue;
    const std::string_view keyword = is_sets ? kSets : kFields;
    const int most = is_sets ? kMostSamples : kMostFields;
    const std::optional<int> count = declared(text, at + keyword.size());
    if (!count || *count > most)
      return fail(Errc::kBadFormat,
                  "reading {}: {} is not a number from 0 to {}; see that it is a table of readings "
                  "and whole",
                  origin,
                  keyword,
                  most);
    int& largest = is_sets ? sets : fields;
    largest = std::max(largest, *count);
  }
  if (!is_whole)
    return fail(Errc::kBadFormat,
                "reading {}: it is no CGATS table, or has broken off: there is no END_DATA; export "
                "it again",
                origin);
  // A value and what parts it from the next take two bytes. So nothing is allocated in vain.
  const std::size_t values = static_cast<std::size_t>(sets) * static_cast<std::size_t>(fields);
  if (values * 2 > text.size())
    return fail(Errc::kBadFormat,
                "reading {}: it declares {} samples of {} values, more than its {} bytes can hold; "
                "it has broken off, copy it again",
                origin,
                sets,
                fields,
                text.size());
  return {};
}

/// One table, loaded and of the right kind, with the names that are asked for at hand.
class Table {
 public:
  static Result<Table> load(std::string_view text,
                            std::string_view origin,
                            std::string_view sheet_type);

  [[nodiscard]] int rows() const { return rows_; }
  /// Empty where there is no such property.
  [[nodiscard]] std::string property(const char* name) const {
    const char* const value = cmsIT8GetProperty(table_.get(), name);
    return value != nullptr ? value : "";
  }
  /// The columns of these names. Errors: kBadFormat.
  template <std::size_t N>
  [[nodiscard]] Result<std::array<int, N>> columns(const std::array<const char*, N>& names) const {
    std::array<int, N> found{};
    for (std::size_t i = 0; i < N; ++i) {
      found[i] = column(names[i]);
      if (found[i] < 0)
        return fail(Errc::kBadFormat,
                    "reading {}: it has no column {}; export it with RGB and XYZ",
                    origin_,
                    names[i]);
    }
    return found;
  }
  /// -1 where there is none.
  [[nodiscard]] int column(std::string_view name) const {
    const auto found = std::ranges::find(fields_, name);
    return found == fields_.end() ? -1 : static_cast<int>(found - fields_.begin());
  }
  [[nodiscard]] std::string text_at(int row, int column) const {
    const char* const value = cmsIT8GetDataRowCol(table_.get(), row, column);
    return value != nullptr ? value : "";
  }
  /// Three numbers of a row. Errors: kBadFormat.
  [[nodiscard]] Result<Eigen::Vector3d> vector_at(int row, const std::array<int, 3>& columns) const;
  [[nodiscard]] const std::string& origin() const { return origin_; }

 private:
  std::unique_ptr<LcmsContext> lcms_;  // on the heap: the table holds its address
  It8 table_;
  std::string origin_;
  std::vector<std::string> fields_;
  int rows_ = 0;
};

/// A number as CGATS writes it; empty for anything else, NaN and infinity among it.
std::optional<double> number_from(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

Result<Table> Table::load(std::string_view text,
                          std::string_view origin,
                          std::string_view sheet_type) {
  VENEER_TRY(check_text(text, origin));
  Table result;
  result.origin_ = origin;
  result.lcms_ = std::make_unique<LcmsContext>();
  result.table_.reset(cmsIT8LoadFromMem(
      result.lcms_->context(), text.data(), static_cast<cmsUInt32Number>(text.size())));
  if (!result.table_)
    return fail(Errc::kBadFormat,
                "reading {}: it is no CGATS table ({}); export it again",
                origin,
                result.lcms_->message());
  cmsHANDLE const table = result.table_.get();
  const std::string_view type = cmsIT8GetSheetType(table);
  if (!type.starts_with(sheet_type))
    return fail(Errc::kBadFormat,
                "reading {}: it is a table of the kind \"{}\", not {}; see that it is the right "
                "file",
                origin,
                printable(type, 20),
                sheet_type);
  // Some programs append further tables (Argyll's calibration curves); the first is what was read.
  cmsIT8SetTable(table, 0);
  char** names = nullptr;
  const int fields = cmsIT8EnumDataFormat(table, &names);
  // A table may declare columns and then not name them.
  for (int i = 0; names != nullptr && i < fields; ++i)
    result.fields_.emplace_back(names[i] != nullptr ? names[i] : "");
  const std::optional<double> rows = number_from(result.property("NUMBER_OF_SETS"));
  if (fields <= 0 || !rows || *rows < 1 || *rows > kMostSamples)
    return fail(Errc::kBadFormat, "reading {}: it holds no samples; export it again", origin);
  result.rows_ = static_cast<int>(*rows);
  return result;
}

Result<Eigen::Vector3d> Table::vector_at(int row, const std::array<int, 3>& columns) const {
  Eigen::Vector3d v;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string text = text_at(row, columns[i]);
    const std::optional<double> value = number_from(text);
    if (!value)
      return fail(Errc::kBadFormat,
                  "reading {}: {} of sample {} of {} is \"{}\", which is no finite number; export "
                  "it again",
                  origin_,
                  printable(fields_[static_cast<std::size_t>(columns[i])], 20),
                  row + 1,
                  rows_,
                  printable(text, 20));
    v(static_cast<Eigen::Index>(i)) = *value;
  }
  return v;
}

/// The drives of all rows, in [0, 1]; whichever of the two scales the file has.
Result<std::vector<Eigen::Vector3d>> drives_of(const Table& table) {
  VENEER_ASSIGN(const auto rgb,
                table.columns(std::array<const char*, 3>{"RGB_R", "RGB_G", "RGB_B"}));
  const int id_column = table.column("SAMPLE_ID");
  std::set<std::string> ids;
  std::vector<Eigen::Vector3d> drives;
  double largest = 0;
  for (int row = 0; row < table.rows(); ++row) {
    if (id_column >= 0) {
      const std::string id = table.text_at(row, id_column);
      if (!ids.insert(id).second)
        return fail(Errc::kBadFormat,
                    "reading {}: the sample id \"{}\" occurs twice; export it again",
                    table.origin(),
                    printable(id, 20));
    }
    VENEER_ASSIGN(const Eigen::Vector3d drive, table.vector_at(row, rgb));
    if (drive.minCoeff() < 0 || drive.maxCoeff() > 100)
      return fail(Errc::kBadFormat,
                  "reading {}: RGB of sample {} is {} {} {}, outside of 0 to 100; export it with "
                  "RGB in percent or from 0 to 1",
                  table.origin(),
                  row + 1,
                  drive.x(),
                  drive.y(),
                  drive.z());
    largest = std::max(largest, drive.maxCoeff());
    drives.push_back(drive);
  }
  if (largest > 1)
    for (Eigen::Vector3d& drive : drives) drive /= 100;
  return drives;
}

/// By what XYZ are to be multiplied to be in cd/m^2.
Result<double> nits_per_unit(const Table& table) {
  const std::string normalised = table.property("NORMALIZED_TO_Y_100");
  const std::string luminance = table.property("LUMINANCE_XYZ_CDM2");
  if (normalised == "NO" || (normalised.empty() && luminance.empty())) return 1.0;
  if (normalised != "YES")
    return fail(Errc::kBadFormat,
                "reading {}: NORMALIZED_TO_Y_100 is \"{}\", so that it is not clear whether its "
                "values are cd/m^2; set it to YES or NO",
                table.origin(),
                printable(normalised, 20));
  // X, Y and Z of white; values relative to its Y = 100 need only Y.
  std::vector<double> xyz;
  for (std::size_t at = 0; at < luminance.size();) {
    const std::size_t begin = luminance.find_first_not_of(" \t", at);
    if (begin == std::string::npos) break;
    const std::size_t end = std::min(luminance.find_first_of(" \t", begin), luminance.size());
    xyz.push_back(number_from(luminance.substr(begin, end - begin)).value_or(-1));
    at = end;
  }
  if (xyz.size() != 3 || !(xyz[1] > 0))
    return fail(Errc::kBadFormat,
                "reading {}: its values are relative to white, and LUMINANCE_XYZ_CDM2 does not say "
                "how bright white is (\"{}\"); export readings in cd/m^2",
                table.origin(),
                printable(luminance, 60));
  return xyz[1] / 100;
}

template <class T>
Result<T> read_with(Result<T> (*parse)(std::string_view, std::string_view),
                    const std::filesystem::path& path) {
  std::error_code no_size;
  const std::uintmax_t size = std::filesystem::file_size(path, no_size);
  if (!no_size && size > kLargestCgats)
    return fail(Errc::kBadFormat,
                "reading {}: it has {} bytes, a table of colours has at most {}; see that it is "
                "the right file",
                path.string(),
                size,
                kLargestCgats);
  VENEER_ASSIGN(const std::string text, read_text(path));
  return parse(text, path.string());
}

}  // namespace

Result<MeasuredPatches> parse_ti3(std::string_view text, std::string_view origin) {
  VENEER_ASSIGN(const Table table, Table::load(text, origin, "CTI3"));
  const std::string device = table.property("DEVICE_CLASS");
  const std::string representation = table.property("COLOR_REP");
  if (device != "DISPLAY" || representation != "RGB_XYZ")
    return fail(Errc::kBadFormat,
                "reading {}: it holds readings of \"{}\" as \"{}\"; those of a DISPLAY as RGB_XYZ "
                "are needed",
                origin,
                printable(device, 20),
                printable(representation, 20));
  VENEER_ASSIGN(const double scale, nits_per_unit(table));
  VENEER_ASSIGN(const std::vector<Eigen::Vector3d> drives, drives_of(table));
  VENEER_ASSIGN(const auto xyz,
                table.columns(std::array<const char*, 3>{"XYZ_X", "XYZ_Y", "XYZ_Z"}));
  MeasuredPatches measured;
  measured.instrument = printable(table.property("TARGET_INSTRUMENT"), 80);
  for (int row = 0; row < table.rows(); ++row) {
    VENEER_ASSIGN(const Eigen::Vector3d value, table.vector_at(row, xyz));
    const Xyz nits = scale * value;
    if (!nits.allFinite())
      return fail(Errc::kBadFormat,
                  "reading {}: XYZ of sample {} are beyond all numbers; export it again",
                  origin,
                  row + 1);
    measured.patches.push_back({drives[static_cast<std::size_t>(row)], nits});
  }
  return measured;
}

Result<MeasuredPatches> read_ti3(const std::filesystem::path& path) {
  return read_with(&parse_ti3, path);
}

Result<std::string> ti3_text(const MeasuredPatches& measured) {
  const std::size_t count = measured.patches.size();
  if (count == 0 || count > kMostSamples)
    return fail(Errc::kBadFormat,
                "writing readings: there are {}; a table holds 1 to {}",
                count,
                kMostSamples);
  for (const PatchReading& patch : measured.patches)
    if (!patch.xyz.allFinite() || !patch.drive.allFinite() ||
        !(patch.drive.minCoeff() >= 0 && patch.drive.maxCoeff() <= 1))
      return fail(Errc::kBadFormat,
                  "writing readings: the drive {} {} {} reads {} {} {}; drives are from 0 to 1 and "
                  "readings finite",
                  patch.drive.x(),
                  patch.drive.y(),
                  patch.drive.z(),
                  patch.xyz.x(),
                  patch.xyz.y(),
                  patch.xyz.z());
  double largest = 0;
  for (const PatchReading& patch : measured.patches)
    largest = std::max(largest, patch.drive.maxCoeff());
  if (largest > 0 && largest <= 0.01)
    return fail(Errc::kBadFormat,
                "writing readings: no drive is above 0.01, so that a reader would take percent for "
                "parts of 1; measure brighter patches too");
  const LcmsContext lcms;
  const It8 owner(cmsIT8Alloc(lcms.context()));
  cmsHANDLE const table = owner.get();
  constexpr std::array kFields{"SAMPLE_ID", "RGB_R", "RGB_G", "RGB_B", "XYZ_X", "XYZ_Y", "XYZ_Z"};
  // Ten digits are more than any instrument gives, and as many as Argyll writes.
  char format[] = "%.10g";
  cmsIT8DefineDblFormat(table, format);
  bool ok = cmsIT8SetSheetType(table, "CTI3   ") != 0;
  const auto set = [&](const char* name, const std::string& value) {
    ok = ok && cmsIT8SetPropertyStr(table, name, value.c_str()) != 0;
  };
  set("DESCRIPTOR", "Argyll Calibration Target chart information 3");
  set("ORIGINATOR", "Veneer");
  set("DEVICE_CLASS", "DISPLAY");
  set("COLOR_REP", "RGB_XYZ");
  if (!measured.instrument.empty()) {
    std::string instrument = printable(measured.instrument, 80);
    std::ranges::replace(instrument, '"', '\'');  // which would end the value
    set("TARGET_INSTRUMENT", instrument);
  }
  set("NORMALIZED_TO_Y_100", "NO");
  ok = ok && cmsIT8SetPropertyDbl(table, "NUMBER_OF_FIELDS", kFields.size()) != 0;
  ok = ok && cmsIT8SetPropertyDbl(table, "NUMBER_OF_SETS", static_cast<double>(count)) != 0;
  for (std::size_t i = 0; i < kFields.size(); ++i)
    ok = ok && cmsIT8SetDataFormat(table, static_cast<int>(i), kFields[i]) != 0;
  for (std::size_t i = 0; ok && i < count; ++i) {
    const int row = static_cast<int>(i);
    const PatchReading& patch = measured.patches[i];
    ok = cmsIT8SetDataRowCol(table, row, 0, fmt::format("{}", i + 1).c_str()) != 0;
    for (int c = 0; c < 3; ++c) {
      ok = ok && cmsIT8SetDataRowColDbl(table, row, 1 + c, 100 * patch.drive(c)) != 0;
      ok = ok && cmsIT8SetDataRowColDbl(table, row, 4 + c, patch.xyz(c)) != 0;
    }
  }
  cmsUInt32Number size = 0;
  ok = ok && cmsIT8SaveToMem(table, nullptr, &size) != 0;
  std::string text(size, '\0');
  ok = ok && cmsIT8SaveToMem(table, text.data(), &size) != 0;
  if (!ok) return fail(Errc::kBadFormat, "writing readings: {}", lcms.message());
  while (!text.empty() && text.back() == '\0') text.pop_back();  // it counts a terminator
  return text;
}

Status write_ti3(const std::filesystem::path& path, const MeasuredPatches& measured) {
  VENEER_ASSIGN(const std::string text, ti3_text(measured));
  return write_text(path, text);
}

Result<std::vector<Eigen::Vector3d>> parse_ti1(std::string_view text, std::string_view origin) {
  VENEER_ASSIGN(const Table table, Table::load(text, origin, "CTI1"));
  const std::string representation = table.property("COLOR_REP");
  if (representation != "RGB" && representation != "iRGB")
    return fail(Errc::kBadFormat,
                "reading {}: its patches are \"{}\"; make the chart for an RGB display",
                origin,
                printable(representation, 20));
  return drives_of(table);
}

Result<std::vector<Eigen::Vector3d>> read_ti1(const std::filesystem::path& path) {
  return read_with(&parse_ti1, path);
}

Result<ColorimeterCorrection> parse_ccmx(std::string_view text, std::string_view origin) {
  VENEER_ASSIGN(const Table table, Table::load(text, origin, "CCMX"));
  if (table.property("COLOR_REP") != "XYZ" || table.rows() != 3)
    return fail(Errc::kBadFormat,
                "reading {}: it holds {} rows of \"{}\"; a correction is three rows of XYZ",
                origin,
                table.rows(),
                printable(table.property("COLOR_REP"), 20));
  VENEER_ASSIGN(const auto xyz,
                table.columns(std::array<const char*, 3>{"XYZ_X", "XYZ_Y", "XYZ_Z"}));
  ColorimeterCorrection correction;
  correction.instrument = printable(table.property("INSTRUMENT"), 80);
  correction.display = printable(table.property("DISPLAY"), 80);
  for (int row = 0; row < 3; ++row) {
    VENEER_ASSIGN(const Eigen::Vector3d values, table.vector_at(row, xyz));
    correction.corrected_from_read.row(row) = values;
  }
  const Eigen::Matrix3d& m = correction.corrected_from_read;
  // Of the box of its rows' lengths; real corrections stay above 0.1.
  constexpr double kLeastVolume = 1e-6;
  const double box = m.row(0).norm() * m.row(1).norm() * m.row(2).norm();
  if (!std::isfinite(box) || !(std::abs(m.determinant()) > kLeastVolume * box))
    return fail(Errc::kBadFormat,
                "reading {}: its matrix cannot be inverted, so that it is no correction; make it "
                "again",
                origin);
  return correction;
}

Result<ColorimeterCorrection> read_ccmx(const std::filesystem::path& path) {
  return read_with(&parse_ccmx, path);
}

}  // namespace veneer::calibration
