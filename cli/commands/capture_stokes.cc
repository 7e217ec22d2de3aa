// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/capture_stokes.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "base/colour.h"
#include "base/exit_code.h"
#include "base/image_files.h"
#include "base/statistics.h"
#include "capture/polarisation/stokes.h"
#include "capture/polarisation/stokes_image.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using capture::StokesImage;

struct StokesOptions {
  std::string sub_command;  // "stokes"
  fs::path image;
  std::string layout;
  double extinction = std::numeric_limits<double>::infinity();
  int full_scale = 65535;  // of a picture of 16 bits; 255 of 8 bits is read as that
  bool demosaic = false;
  fs::path output;
};

/// Light below which noise looks polarised, in counts of 8 bits.
constexpr double kLeastS0 = 40;

void declare(CLI::App& app, StokesOptions& options) {
  app.add_option("stokes", options.sub_command)->required();
  app.add_option("image", options.image, "A raw picture, grey PNG of 8 or 16 bits")->required();
  app.add_option(
         "--layout", options.layout, "Where the analysers are: polarsens-mono or polarsens-colour")
      ->required();
  app.add_option("--extinction",
                 options.extinction,
                 "Imax / Imin of the analysers, which the maker states (default: perfect ones)");
  app.add_option("--full-scale",
                 options.full_scale,
                 "Counts of a saturated pixel in a picture of 16 bits, where it is not all of them")
      ->check(CLI::Range(1, 65535))
      ->capture_default_str();
  app.add_flag("--demosaic",
               options.demosaic,
               "Interpolate to full resolution (default: cell by cell, nothing interpolated)");
  app.add_option("-o,--output", options.output, "A folder for pictures to look at and stokes.exr");
}

Result<Image<Rgb32f>> read_counts(const fs::path& path) {
  VENEER_ASSIGN(const Image<Rgb16> pixels, read_png16(path));
  Image<Rgb32f> counts(pixels.width(), pixels.height());
  for (int y = 0; y < counts.height(); ++y) {
    for (int x = 0; x < counts.width(); ++x) {
      const Rgb16& pixel = pixels(x, y);
      if (pixel[0] != pixel[1] || pixel[1] != pixel[2])
        return fail(Errc::kBadFormat,
                    "{}: a picture in colour is no raw mosaic; save what the sensor read, one grey "
                    "value for each pixel, before any conversion to colour",
                    path.string());
      counts(x, y).setConstant(pixel[0]);
    }
  }
  return counts;
}

std::uint8_t code_of(double value) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
}

/// The colours of a wheel at an angle of polarisation, whose half turn is the whole of it.
Rgb8 wheel_colour(double angle_rad, double brightness) {
  const auto part = [&](double offset) {
    // A triangle wave from 0 to 1 and back, cut to a trapezium: red, yellow, green, ...
    const double turn = angle_rad / std::numbers::pi + offset;
    return std::clamp(6 * std::abs(turn - std::floor(turn) - 0.5) - 1, 0.0, 1.0);
  };
  return {code_of(brightness * part(0)),
          code_of(brightness * part(2.0 / 3)),
          code_of(brightness * part(1.0 / 3))};
}

/// Which colour of aolp.png is which direction of the field.
Image<Rgb8> wheel() {
  constexpr int kSize = 256;
  Image<Rgb8> picture(kSize, kSize);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double right = (x + 0.5) / kSize - 0.5;
      const double up = 0.5 - (y + 0.5) / kSize;
      if (std::hypot(right, up) < 0.5) picture(x, y) = wheel_colour(std::atan2(up, right), 1);
    }
  }
  return picture;
}

struct Pictures {
  Image<Rgb8> light, degree, angle, saturated;
};
/// Saturated is magenta, of the angle white; what is too dark to tell is black.
Pictures pictures_of(const StokesImage& image, double least_s0, double brightest_degree) {
  const int width = image.s0.width();
  const int height = image.s0.height();
  std::vector<double> lights;
  lights.reserve(image.s0.pixels().size());
  for (const Rgb32f& pixel : image.s0.pixels()) lights.push_back(pixel[1]);
  const double exposure = 0.9 / std::max(quantile(std::move(lights), 0.99), 1.0);

  Pictures pictures{Image<Rgb8>(width, height),
                    Image<Rgb8>(width, height),
                    Image<Rgb8>(width, height),
                    Image<Rgb8>(width, height)};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (image.saturated(x, y) != 0) {
        pictures.light(x, y) = pictures.degree(x, y) = {255, 0, 255};
        pictures.angle(x, y) = pictures.saturated(x, y) = {255, 255, 255};
        continue;
      }
      for (int c = 0; c < 3; ++c)
        pictures.light(x, y)[static_cast<std::size_t>(c)] =
            code_of(srgb_encode(exposure * image.s0(x, y)[c]));
      const capture::LinearStokes stokes(image.s0(x, y)[1], image.s1(x, y)[1], image.s2(x, y)[1]);
      if (!(stokes[0] >= least_s0)) continue;
      const double degree = capture::degree_of_polarisation(stokes);
      pictures.degree(x, y).fill(code_of(degree));
      pictures.angle(x, y) =
          wheel_colour(capture::angle_of_polarisation(stokes), degree / brightest_degree);
    }
  }
  return pictures;
}

/// In parts of full scale; monochrome sensors have one channel of each.
std::vector<ExrChannel> exr_channels(const StokesImage& image, double full_scale, bool colour) {
  const auto channel = [&](std::string name, const auto& value_at) {
    ExrChannel result{std::move(name), Image<float>(image.s0.width(), image.s0.height())};
    for (int y = 0; y < image.s0.height(); ++y) {
      for (int x = 0; x < image.s0.width(); ++x) result.pixels(x, y) = value_at(x, y);
    }
    return result;
  };
  const auto unit = static_cast<float>(full_scale);
  std::vector<ExrChannel> channels;
  const auto add = [&](const std::string& name, const Image<Rgb32f>& plane) {
    for (int c = 0; c < (colour ? 3 : 1); ++c)
      channels.push_back(channel(colour ? name + "." + "RGB"[c] : name,
                                 [&](int x, int y) { return plane(x, y)[c] / unit; }));
  };
  add("S0", image.s0);
  add("S1", image.s1);
  add("S2", image.s2);
  channels.push_back(channel(
      "saturated", [&](int x, int y) { return static_cast<float>(image.saturated(x, y)); }));
  return channels;
}

}  // namespace

Result<int> capture_stokes(CommandLine& line) {
  StokesOptions options;
  declare(line.app(), options);
  line.parse();
  VENEER_ASSIGN(const capture::Mosaic mosaic, capture::mosaic_named(options.layout));
  VENEER_ASSIGN(const Image<Rgb32f> counts, read_counts(options.image));
  const auto cells = options.demosaic ? capture::demosaic(counts, options.full_scale, mosaic)
                                      : capture::mosaic_cells(counts, options.full_scale, mosaic);
  if (!cells) return fail_while(options.image.string(), cells.error());
  VENEER_ASSIGN(const StokesImage image, capture::stokes_image(*cells, options.extinction));
  const double least_s0 = kLeastS0 * options.full_scale / 255;
  const capture::PolarisationSummary summary = capture::summarise(image, least_s0);

  if (!options.output.empty()) {
    const Image<Rgb8> wheel_picture = wheel();
    const Pictures pictures = pictures_of(image, least_s0, std::max(summary.dolp_p999, 0.01));
    VENEER_TRY(write_png(options.output / "s0.png", pictures.light.view()));
    VENEER_TRY(write_png(options.output / "dolp.png", pictures.degree.view()));
    VENEER_TRY(write_png(options.output / "aolp.png", pictures.angle.view()));
    VENEER_TRY(write_png(options.output / "aolp_wheel.png", wheel_picture.view()));
    VENEER_TRY(write_png(options.output / "saturated.png", pictures.saturated.view()));
    VENEER_TRY(write_exr(
        options.output / "stokes.exr",
        exr_channels(image, options.full_scale, mosaic == capture::Mosaic::kPolarColour)));
  }
  if (summary.cells_used == 0)
    line.note(
        fmt::format("{}: no cell is both bright enough and below saturation; change the "
                    "exposure",
                    options.image.string()));
  const nlohmann::ordered_json json{{"width", image.s0.width()},
                                    {"height", image.s0.height()},
                                    {"dolp_p50", summary.dolp_p50},
                                    {"dolp_p95", summary.dolp_p95},
                                    {"dolp_p999", summary.dolp_p999},
                                    {"residual_median", summary.residual_median},
                                    {"saturated_fraction", summary.saturated_fraction},
                                    {"cells_used", summary.cells_used}};
  line.print(json,
             fmt::format("{} x {} {}, {} usable, {:.1f} % saturated\n"
                         "degree of polarisation: median {:.3f}, 95 % below {:.3f}, 99.9 % below "
                         "{:.3f}\n"
                         "bias between the analysers: {:+.2f} % of the light",
                         image.s0.width(),
                         image.s0.height(),
                         options.demosaic ? "pixels" : "cells",
                         summary.cells_used,
                         100 * summary.saturated_fraction,
                         summary.dolp_p50,
                         summary.dolp_p95,
                         summary.dolp_p999,
                         100 * summary.residual_median));
  return kExitDone;
}

}  // namespace veneer::cli
