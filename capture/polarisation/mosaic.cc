// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/mosaic.h"

#include <algorithm>
#include <cstddef>
#include <numbers>
#include <utility>

namespace veneer::capture {
namespace {

constexpr int kAngles = 4;

struct Place {
  int x, y;
};
/// Where in a cell of 2 x 2 the analysers at 0, 45, 90, 135 degrees are.
constexpr std::array<Place, kAngles> kPlaces{{{1, 1}, {1, 0}, {0, 0}, {0, 1}}};

/// Values on a grid of pixels, each as far from the next as the other: pixel = offset + period * i.
struct Grid {
  Image<float> values;
  Image<std::uint8_t> saturated;
  int period = 0;
  Place offset{};
};

/// The pixels of one angle and one colour; `channel` of the picture is read.
Grid taken(const Image<Rgb32f>& counts, double full_scale, int period, Place offset, int channel) {
  Grid grid;
  grid.period = period;
  grid.offset = offset;
  grid.values = Image<float>(counts.width() / period, counts.height() / period);
  grid.saturated = Image<std::uint8_t>(grid.values.width(), grid.values.height());
  for (int y = 0; y < grid.values.height(); ++y) {
    for (int x = 0; x < grid.values.width(); ++x) {
      const float value = counts(offset.x + period * x, offset.y + period * y)[channel];
      grid.values(x, y) = value;
      grid.saturated(x, y) = value < full_scale ? 0 : 1;  // and where it is no number
    }
  }
  return grid;
}

/// The colours of one angle of a colour mosaic; green lies on two grids.
struct ColourGrids {
  Grid red, green_right, green_below, blue;
};
ColourGrids colour_grids(const Image<Rgb32f>& counts, double full_scale, Place place) {
  const auto at = [&](int x, int y, int channel) {
    return taken(counts, full_scale, 4, {place.x + x, place.y + y}, channel);
  };
  return {at(0, 0, 0), at(2, 0, 1), at(0, 2, 1), at(2, 2, 2)};
}

/// One grid of twice the density from the two of green, which lie on it like one colour of a
/// chessboard: in between stands the mean of the neighbours, of opposite pairs only at a side.
Grid joined_green(const ColourGrids& grids) {
  const Image<float>& right = grids.green_right.values;
  Grid green;
  green.period = 2;
  green.offset = {grids.red.offset.x, grids.red.offset.y};
  const int width = 2 * right.width();
  const int height = 2 * right.height();
  green.values = Image<float>(width, height);
  green.saturated = Image<std::uint8_t>(width, height);
  for (int y = 0; y < right.height(); ++y) {
    for (int x = 0; x < right.width(); ++x) {
      green.values(2 * x + 1, 2 * y) = right(x, y);
      green.saturated(2 * x + 1, 2 * y) = grids.green_right.saturated(x, y);
      green.values(2 * x, 2 * y + 1) = grids.green_below.values(x, y);
      green.saturated(2 * x, 2 * y + 1) = grids.green_below.saturated(x, y);
    }
  }
  const auto mean_of = [&](int x, int y, std::initializer_list<Place> from) {
    float sum = 0;
    std::uint8_t saturated = 0;
    for (const Place& step : from) {
      sum += green.values(x + step.x, y + step.y);
      saturated |= green.saturated(x + step.x, y + step.y);
    }
    green.values(x, y) = sum / static_cast<float>(from.size());
    green.saturated(x, y) = saturated;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = y % 2; x < width; x += 2) {
      const bool left_or_right = x == 0 || x == width - 1;
      const bool top_or_bottom = y == 0 || y == height - 1;
      if (!left_or_right && !top_or_bottom)
        mean_of(x, y, {{-1, 0}, {1, 0}, {0, -1}, {0, 1}});
      else if (!top_or_bottom)
        mean_of(x, y, {{0, -1}, {0, 1}});
      else if (!left_or_right)
        mean_of(x, y, {{-1, 0}, {1, 0}});
    }
  }
  // Two corners are left, which continue the plane through the three others of their square.
  for (const Place inward : {Place{1, 1}, Place{-1, -1}}) {
    const int x = inward.x > 0 ? 0 : width - 1;
    const int y = inward.y > 0 ? 0 : height - 1;
    if (width == 2 && height == 2) {
      mean_of(x, y, {{inward.x, 0}, {0, inward.y}});
      continue;
    }
    green.values(x, y) = green.values(x + inward.x, y) + green.values(x, y + inward.y) -
                         green.values(x + inward.x, y + inward.y);
    green.saturated(x, y) = green.saturated(x + inward.x, y) | green.saturated(x, y + inward.y) |
                            green.saturated(x + inward.x, y + inward.y);
  }
  return green;
}

/// Between which two of a grid's lines a pixel lies, and how far towards the second: outside of
/// [0, 1] at a border, where the line through both goes on.
struct Between {
  int first = 0;
  int second = 0;
  float share = 0;
};
std::vector<Between> between_lines(int pixels, int lines, int period, int offset) {
  std::vector<Between> result(static_cast<std::size_t>(pixels));
  if (lines < 2) return result;
  for (int i = 0; i < pixels; ++i) {
    const int first = std::clamp((i - offset + period) / period - 1, 0, lines - 2);
    result[static_cast<std::size_t>(i)] = {
        first,
        first + 1,
        static_cast<float>(i - offset - period * first) / static_cast<float>(period)};
  }
  return result;
}

/// Interpolates a grid into the channels [first, last] of a picture.
void spread(
    const Grid& grid, int first, int last, Image<Rgb32f>& picture, Image<std::uint8_t>& saturated) {
  const std::vector<Between> columns =
      between_lines(picture.width(), grid.values.width(), grid.period, grid.offset.x);
  const std::vector<Between> rows =
      between_lines(picture.height(), grid.values.height(), grid.period, grid.offset.y);
  for (int y = 0; y < picture.height(); ++y) {
    const Between& row = rows[static_cast<std::size_t>(y)];
    for (int x = 0; x < picture.width(); ++x) {
      const Between& column = columns[static_cast<std::size_t>(x)];
      float value = 0;
      std::uint8_t clipped = 0;
      const auto add = [&](int grid_x, int grid_y, float weight) {
        if (weight == 0) return;  // what does not count may be saturated
        value += weight * grid.values(grid_x, grid_y);
        clipped |= grid.saturated(grid_x, grid_y);
      };
      add(column.first, row.first, (1 - column.share) * (1 - row.share));
      add(column.second, row.first, column.share * (1 - row.share));
      add(column.first, row.second, (1 - column.share) * row.share);
      add(column.second, row.second, column.share * row.share);
      for (int channel = first; channel <= last; ++channel) picture(x, y)[channel] = value;
      saturated(x, y) |= clipped;
    }
  }
}

Status check(const Image<Rgb32f>& counts, Mosaic mosaic) {
  if (mosaic == Mosaic::kNone)
    return fail(Errc::kBadFormat,
                "taking a mosaic apart: the picture has no analysers on its pixels; name the "
                "camera's layout, or take pictures at several angles of an analyser");
  const int cell = mosaic == Mosaic::kPolarColour ? 4 : 2;
  if (counts.empty() || counts.width() % cell != 0 || counts.height() % cell != 0)
    return fail(Errc::kBadFormat,
                "taking a mosaic apart: {} x {} pixels are no whole number of cells of {} x {}; "
                "give the picture as the camera took it, neither cropped nor scaled",
                counts.width(),
                counts.height(),
                cell,
                cell);
  return {};
}

MosaicCells empty_cells(int width, int height) {
  MosaicCells cells;
  for (Image<Rgb32f>& picture : cells.counts) picture = Image<Rgb32f>(width, height);
  cells.saturated = Image<std::uint8_t>(width, height);
  return cells;
}

}  // namespace

const std::array<double, 4>& mosaic_angles() {
  using std::numbers::pi;
  static constexpr std::array<double, 4> kAnglesRad{0, pi / 4, pi / 2, 3 * pi / 4};
  return kAnglesRad;
}

Result<Mosaic> mosaic_named(std::string_view name) {
  if (name == "polarsens-mono") return Mosaic::kPolarMono;
  if (name == "polarsens-colour") return Mosaic::kPolarColour;
  return fail(Errc::kInvalidOption,
              "there is no layout of analysers \"{}\"; there are polarsens-mono and "
              "polarsens-colour",
              name);
}

Result<MosaicCells> mosaic_cells(const Image<Rgb32f>& counts, double full_scale, Mosaic mosaic) {
  VENEER_TRY(check(counts, mosaic));
  const int size = mosaic == Mosaic::kPolarColour ? 4 : 2;
  MosaicCells cells = empty_cells(counts.width() / size, counts.height() / size);
  for (std::size_t angle = 0; angle < kAngles; ++angle) {
    Image<Rgb32f>& picture = cells.counts[angle];
    const auto fill = [&](const auto& colour_of, std::initializer_list<const Grid*> grids) {
      for (int y = 0; y < picture.height(); ++y) {
        for (int x = 0; x < picture.width(); ++x) {
          picture(x, y) = colour_of(x, y);
          for (const Grid* grid : grids) cells.saturated(x, y) |= grid->saturated(x, y);
        }
      }
    };
    if (mosaic == Mosaic::kPolarMono) {
      const Grid grid = taken(counts, full_scale, 2, kPlaces[angle], 0);
      fill([&](int x, int y) { return Rgb32f(Rgb32f::Constant(grid.values(x, y))); }, {&grid});
    } else {
      const ColourGrids grids = colour_grids(counts, full_scale, kPlaces[angle]);
      const auto colour_of = [&](int x, int y) {
        const float green = grids.green_right.values(x, y) + grids.green_below.values(x, y);
        return Rgb32f(grids.red.values(x, y), 0.5F * green, grids.blue.values(x, y));
      };
      fill(colour_of, {&grids.red, &grids.green_right, &grids.green_below, &grids.blue});
    }
  }
  return cells;
}

Result<MosaicCells> demosaic(const Image<Rgb32f>& counts, double full_scale, Mosaic mosaic) {
  VENEER_TRY(check(counts, mosaic));
  MosaicCells cells = empty_cells(counts.width(), counts.height());
  for (std::size_t angle = 0; angle < kAngles; ++angle) {
    Image<Rgb32f>& picture = cells.counts[angle];
    if (mosaic == Mosaic::kPolarMono) {
      const Grid grid = taken(counts, full_scale, 2, kPlaces[angle], 0);
      spread(grid, 0, 2, picture, cells.saturated);
    } else {
      const ColourGrids grids = colour_grids(counts, full_scale, kPlaces[angle]);
      spread(grids.red, 0, 0, picture, cells.saturated);
      spread(joined_green(grids), 1, 1, picture, cells.saturated);
      spread(grids.blue, 2, 2, picture, cells.saturated);
    }
  }
  return cells;
}

}  // namespace veneer::capture
