// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/btfbase/code_books.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <type_traits>
#include <utility>

#include "base/files.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;

constexpr double kPi = std::numbers::pi;

// Reads numbers one after the other.
class NumberReader {
 public:
  explicit NumberReader(const std::string& text)
      : next_(text.data()), end_(text.data() + text.size()) {}
  template <class Number>
  bool read(Number& value) {
    skip_space();
    const auto [after, error] = std::from_chars(next_, end_, value);
    if (error != std::errc{}) return false;
    next_ = after;
    return true;
  }
  bool at_end() {
    skip_space();
    return next_ == end_;
  }

 private:
  void skip_space() {
    while (next_ != end_ && (*next_ == ' ' || *next_ == '\n' || *next_ == '\r' || *next_ == '\t'))
      ++next_;
  }
  const char* next_;
  const char* end_;
};

// The only file of the folder whose name ends so.
Result<fs::path> find_table(const fs::path& folder, const std::string& ending) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().filename().string().ends_with(ending)) found.push_back(entry->path());
  }
  if (error)
    return fail(Errc::kNotFound, "reading code-books {}: {}", folder.string(), error.message());
  if (found.size() == 1) return found.front();
  if (found.empty())
    return fail(Errc::kNotFound, "reading code-books {}: there is no *{}", folder.string(), ending);
  return fail(Errc::kBadFormat,
              "reading code-books {}: there are {} files *{}; the folder must hold one material",
              folder.string(),
              found.size(),
              ending);
}

// A turn in [0, 2 pi). Directions on a knot come with the rounding of their cosines; what is within
// it of a full turn is 0.
double turn(double angle) {
  constexpr double kRounding = 1e-12;
  const double wrapped = std::fmod(std::fmod(angle, 2.0 * kPi) + 2.0 * kPi, 2.0 * kPi);
  return wrapped > 2.0 * kPi - kRounding ? 0.0 : wrapped;
}

CodeBooks::Knot even_knot(double position, int last_low) {
  const int low = std::clamp(static_cast<int>(position), 0, last_low);
  return {low, std::clamp(position - low, 0.0, 1.0)};
}

// ITU-R BT.601, Y from 16 to 235 and Cb, Cr about 128, to 0 to 255.
Eigen::Vector3d rgb_from_ycbcr(double y, double cb, double cr) {
  return {1.1643828 * y + 1.5960273 * cr - 222.921,
          1.1643828 * y - 0.39176172 * cb - 0.81296875 * cr + 135.576,
          1.1643828 * y + 2.0172344 * cb - 276.836};
}

}  // namespace

template <class Number>
Result<CodeBooks::Table<Number>> CodeBooks::read_table(const fs::path& path) {
  VENEER_ASSIGN(const std::string text, read_text(path));
  NumberReader reader(text);
  Table<Number> table;
  double least = 0.0;
  double most = 0.0;
  if (!reader.read(table.rows) || !reader.read(table.columns) || !reader.read(least) ||
      !reader.read(most) || table.rows <= 0 || table.columns <= 0)
    return fail(Errc::kBadFormat,
                "reading {}: expected \"rows columns minimum maximum\" first",
                path.string());
  const auto count = static_cast<std::size_t>(table.rows) * static_cast<std::size_t>(table.columns);
  // Every number takes at least a digit and a space, so a damaged header cannot ask for much
  // memory.
  if (count > text.size())
    return fail(Errc::kBadFormat,
                "reading {}: it states {} x {} numbers, more than it can hold",
                path.string(),
                table.rows,
                table.columns);
  table.values.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    bool good = reader.read(table.values[i]);
    if constexpr (std::is_floating_point_v<Number>) good = good && std::isfinite(table.values[i]);
    if (!good)
      return fail(Errc::kBadFormat,
                  "reading {}: number {} of {} is missing or damaged",
                  path.string(),
                  i + 1,
                  count);
  }
  if (!reader.at_end())
    return fail(Errc::kBadFormat,
                "reading {}: more follows after its {} x {} numbers",
                path.string(),
                table.rows,
                table.columns);
  return table;
}

Result<CodeBooks> CodeBooks::read(const fs::path& folder) {
  CodeBooks books;
  const auto load = [&folder]<class Number>(const std::string& ending,
                                            Table<Number>& table) -> Status {
    VENEER_ASSIGN(const fs::path path, find_table(folder, ending));
    VENEER_ASSIGN(table, read_table<Number>(path));
    return {};
  };
  VENEER_TRY(load("_PDF6Dslices.txt", books.slices6_));
  VENEER_TRY(load("_PDF6Dscale.txt", books.scale6_));
  VENEER_TRY(load("_PDF4Dslices.txt", books.slices4_));
  VENEER_TRY(load("_PDF4Dscale.txt", books.scale4_));
  VENEER_TRY(load("_PDF3Dslices.txt", books.slices3_));
  VENEER_TRY(load("_PDF3Dscale.txt", books.scale3_));
  VENEER_TRY(load("_PDF2Dindices.txt", books.pairs2_));
  VENEER_TRY(load("_PDF2Dslices.txt", books.slices2_));
  VENEER_TRY(load("_PDF2Dscale.txt", books.scale2_));
  VENEER_TRY(load("_PDF1Dslice.txt", books.curves_));
  VENEER_TRY(load("_PDF2Dcolours.txt", books.colours2_));
  VENEER_TRY(load("_indexAB.txt", books.indices_));
  VENEER_TRY(load("_colors.txt", books.chroma_));
  VENEER_TRY(books.check(folder));
  const int knots = books.curves_.columns;
  for (int i = 0; i < knots; ++i)
    books.beta_knots_.push_back(std::asin(std::clamp(2.0 * i / (knots - 1) - 1.0, -1.0, 1.0)));
  return books;
}

Status CodeBooks::check(const fs::path& folder) const {
  const auto damaged = [&folder](std::string_view what) {
    return fail(Errc::kBadFormat, "reading code-books {}: {}", folder.string(), what);
  };
  const auto same = [](const auto& a, const auto& b) {
    return a.rows == b.rows && a.columns == b.columns;
  };
  if (!same(slices6_, scale6_)) return damaged("PDF6Dslices and PDF6Dscale differ in size");
  if (!same(slices4_, scale4_)) return damaged("PDF4Dslices and PDF4Dscale differ in size");
  if (!same(slices3_, scale3_)) return damaged("PDF3Dslices and PDF3Dscale differ in size");
  if (!same(slices2_, scale2_)) return damaged("PDF2Dslices and PDF2Dscale differ in size");
  if (pairs2_.columns != 2 || chroma_.columns != 2)
    return damaged("PDF2Dindices and colors must have two columns");
  if (colours2_.columns != slices2_.columns)
    return damaged("PDF2Dcolours and PDF2Dslices differ in columns");
  if (indices_.columns != curves_.columns)
    return damaged("indexAB and PDF1Dslice differ in columns");
  for (const int columns : {slices4_.columns, slices3_.columns, slices2_.columns, curves_.columns})
    if (columns < 2) return damaged("an angle has fewer than two knots");
  // Every index points at a row that is there.
  const auto within = [](const Table<int>& table, int first, int count) {
    return std::all_of(table.values.begin(), table.values.end(), [&](int i) {
      return i >= first && i < first + count;
    });
  };
  if (!within(slices6_, 1, slices4_.rows))
    return damaged("PDF6Dslices points outside PDF4Dslices (it counts from 1)");
  if (!within(slices4_, 0, slices3_.rows)) return damaged("PDF4Dslices points outside PDF3Dslices");
  if (!within(slices3_, 0, pairs2_.rows)) return damaged("PDF3Dslices points outside PDF2Dindices");
  for (int i = 0; i < pairs2_.rows; ++i) {
    if (pairs2_(i, 0) < 0 || pairs2_(i, 0) >= slices2_.rows)
      return damaged("PDF2Dindices points outside PDF2Dslices");
    if (pairs2_(i, 1) < 0 || pairs2_(i, 1) >= colours2_.rows)
      return damaged("PDF2Dindices points outside PDF2Dcolours");
  }
  if (!within(slices2_, 0, curves_.rows)) return damaged("PDF2Dslices points outside PDF1Dslice");
  if (!within(colours2_, 0, indices_.rows)) return damaged("PDF2Dcolours points outside indexAB");
  if (!within(indices_, 0, chroma_.rows)) return damaged("indexAB points outside colors");
  return {};
}

CodeBooks::Place CodeBooks::place_of(const Direction& view, const Direction& light) const {
  const Angles v = angles_from_direction(view);
  const Angles l = angles_from_direction(light);
  // The code-books turn clockwise, and the light is taken relative to the view's azimuth.
  const double phi_v = turn(-v.phi);
  const double phi_l = turn(-l.phi - (kPi / 2.0 + phi_v));
  const double x = std::cos(phi_l) * std::sin(l.theta);
  const double y = std::sin(phi_l) * std::sin(l.theta);
  const double beta = std::asin(std::clamp(x, -1.0, 1.0));
  const double cos_beta = std::cos(beta);
  // At beta = +-90 degrees every alpha is the same point; the books use 0.
  constexpr double kPole = 1e-3;
  const double alpha = cos_beta < kPole ? 0.0 : std::asin(std::clamp(y / cos_beta, -1.0, 1.0));

  Place place;
  place.phi = even_knot(phi_v / (2.0 * kPi) * slices4_.columns, slices4_.columns - 1);
  place.theta = even_knot(v.theta / (kPi / 2.0) * (slices3_.columns - 1), slices3_.columns - 2);
  place.alpha = even_knot((alpha / kPi + 0.5) * (slices2_.columns - 1), slices2_.columns - 2);
  // Beta's knots are even in its sine, but the weight is taken in the angle.
  const auto above = std::upper_bound(beta_knots_.begin() + 1, beta_knots_.end() - 1, beta);
  const auto low = above - 1;
  place.beta = {static_cast<int>(low - beta_knots_.begin()), (beta - *low) / (*above - *low)};
  return place;
}

// Cubic Hermite with tangents of half the distance between a knot's neighbours; of the one interval
// at either end.
double CodeBooks::spline(int function, const Knot& beta) const {
  const int last = curves_.columns - 1;
  const double w = beta.weight;
  const double p0 = curves_(function, beta.low);
  const double p1 = curves_(function, beta.low + 1);
  const double m0 = beta.low == 0 ? p1 - p0 : 0.5 * (p1 - curves_(function, beta.low - 1));
  const double m1 = beta.low + 1 == last ? p1 - p0 : 0.5 * (curves_(function, beta.low + 2) - p0);
  const double w2 = w * w;
  const double w3 = w2 * w;
  return (2.0 * w3 - 3.0 * w2 + 1.0) * p0 + (w3 - 2.0 * w2 + w) * m0 + (3.0 * w2 - 2.0 * w3) * p1 +
         (w3 - w2) * m1;
}

double CodeBooks::luminance(int function, const Place& place) const {
  const int low = place.alpha.low;
  const double a = scale2_(function, low) * spline(slices2_(function, low), place.beta);
  const double b = scale2_(function, low + 1) * spline(slices2_(function, low + 1), place.beta);
  return std::lerp(a, b, place.alpha.weight);
}

Eigen::Vector2d CodeBooks::chroma(int function, const Place& place) const {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const int i : {0, 1}) {
    const int row = colours2_(function, place.alpha.low + i);
    const double row_weight = i == 0 ? 1.0 - place.alpha.weight : place.alpha.weight;
    for (const int j : {0, 1}) {
      const int colour = indices_(row, place.beta.low + j);
      const double weight = row_weight * (j == 0 ? 1.0 - place.beta.weight : place.beta.weight);
      sum += weight * Eigen::Vector2d(chroma_(colour, 0), chroma_(colour, 1));
    }
  }
  return sum;
}

Eigen::Vector3d CodeBooks::colour(int function, const Place& place) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int i : {0, 1}) {
    const int phi = (place.phi.low + i) % slices4_.columns;
    const double phi_weight =
        (i == 0 ? 1.0 - place.phi.weight : place.phi.weight) * scale4_(function, phi);
    const int function3 = slices4_(function, phi);
    for (const int j : {0, 1}) {
      const int theta = place.theta.low + j;
      const double weight = phi_weight * (j == 0 ? 1.0 - place.theta.weight : place.theta.weight) *
                            scale3_(function3, theta);
      if (weight == 0.0) continue;
      const int function2 = slices3_(function3, theta);
      const Eigen::Vector2d cb_cr = chroma(pairs2_(function2, 1), place);
      // Scales act on the colour, not on its luminance alone.
      sum += weight * rgb_from_ycbcr(luminance(pairs2_(function2, 0), place), cb_cr[0], cb_cr[1]);
    }
  }
  return sum;
}

}  // namespace veneer::btf
