// SPDX-License-Identifier: Apache-2.0
#include "calibration/radiometry.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "calibration/interpolation.h"

namespace veneer::calibration {
namespace {

constexpr std::array<std::string_view, 3> kChannelNames{"red", "green", "blue"};
/// Under this part of the strongest channel's light a channel counts as dead.
constexpr double kLeastChannel = 1e-3;
/// How far a ramp may fall, in parts of full output: more than any instrument's noise.
constexpr double kLargestFall = 0.02;
constexpr double kLargestAdditivityError = 0.03;
constexpr double kLargestColourDrift = 0.03;
constexpr double kLargestAmbientMismatch = 0.1;
/// Spots at the very edge would not lie in the picture whole; this part of the raster is left out
/// on each side and extrapolated over.
constexpr double kMargin = 0.03;
/// Texels of the stored vignetting at most: half a texel, which bilinear lookup cannot extrapolate
/// over, is then under 1 % of the raster.
constexpr int kVignettingWidth = 64;
constexpr int kVignettingHeight = 48;

/// cos of the angle between the projector's axis and the ray of `pixel`.
double axis_cosine(const ProjectorGeometry& geometry, const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d ray(
      (pixel.x() - geometry.cx) / geometry.fx, (pixel.y() - geometry.cy) / geometry.fy, 1.0);
  return 1.0 / ray.norm();
}

Eigen::Vector2d raster_centre(const ProjectorGeometry& geometry) {
  return {0.5 * geometry.width, 0.5 * geometry.height};
}

/// The devices, with retries, averaging and checks of what is read.
class Session {
 public:
  Session(Colorimeter& colorimeter, PatchDisplay& display, Progress& progress)
      : colorimeter_(colorimeter), display_(display), progress_(progress) {}

  [[nodiscard]] Status show(const std::array<std::uint16_t, 3>& code, bool lit = true) {
    return display_.show(code, lit);
  }

  /// The mean of `repeats` readings.   @param what  for error messages.
  [[nodiscard]] Result<Xyz> read(Target target,
                                 const Eigen::Vector2d& pixel,
                                 int repeats,
                                 std::string_view what) {
    Xyz sum = Xyz::Zero();
    for (int i = 0; i < repeats; ++i) {
      auto reading = read_patiently(target, pixel);
      if (!reading) return fail_while(fmt::format("reading {}", what), reading.error());
      if (!reading->allFinite())
        return fail(Errc::kBadFormat,
                    "reading {}: {} gave a value that is not a number; check that it is not "
                    "overexposed and read again",
                    what,
                    colorimeter_.description());
      sum += *reading;
      ++readings_;
      progress_.advance();
    }
    return Xyz(sum / repeats);
  }

  [[nodiscard]] int readings() const { return readings_; }

 private:
  Result<Xyz> read_patiently(Target target, const Eigen::Vector2d& pixel) {
    constexpr int kAttempts = 3;
    for (int attempt = 1;; ++attempt) {
      auto reading = colorimeter_.read(target, pixel);
      if (reading || reading.error().code != Errc::kTimeout || attempt == kAttempts) return reading;
    }
  }

  Colorimeter& colorimeter_;
  PatchDisplay& display_;
  Progress& progress_;
  int readings_ = 0;
};

/// Readings of the centre of one target, not corrected for the board's slant.
struct TargetReadings {
  Xyz ambient;
  Xyz black;             // with the ambient light
  Eigen::Matrix3d full;  // columns: each channel at full drive, above black
};

class Measurement {
 public:
  Measurement(Session& session, const ProjectorGeometry& geometry, const RadiometryOptions& options)
      : session_(session),
        options_(options),
        centre_(raster_centre(geometry)),
        ramp_(ramp_codes(options.bits, options.levels)) {
    result_.profile.geometry = geometry;
    result_.profile.bits = options.bits;
    result_.profile.reference_distance_m = options.reference_distance_m;
  }

  Result<MeasuredProfile> run() {
    VENEER_ASSIGN(white_, read_target(Target::kWhiteReference, "the white reference"));
    VENEER_TRY(set_ambient_and_black());
    VENEER_TRY(check_channels());
    for (int channel = 0; channel < 3; ++channel) VENEER_TRY(measure_ramp(channel));
    VENEER_TRY(measure_additivity());
    VENEER_TRY(measure_vignetting());
    VENEER_ASSIGN(const TargetReadings object, read_target(Target::kObject, "the object"));
    VENEER_TRY(set_surface(object));
    // M and k are those of a diffuser that faces the lens at the reference distance.
    const double slant = std::pow(axis_cosine(result_.profile.geometry, centre_), 3);
    result_.profile.primaries /= slant;
    result_.profile.black /= slant;
    if (const Status valid = result_.profile.check(); !valid)
      return fail_while("making a profile of the readings", valid.error());
    result_.readings = session_.readings();
    return std::move(result_);
  }

 private:
  [[nodiscard]] std::array<std::uint16_t, 3> drive(int channel, std::uint16_t code) const {
    std::array<std::uint16_t, 3> codes{};
    codes[static_cast<std::size_t>(channel)] = code;
    return codes;
  }

  Result<Xyz> show_and_read(Target target,
                            const std::array<std::uint16_t, 3>& code,
                            int repeats,
                            std::string_view what) {
    VENEER_TRY(session_.show(code));
    return session_.read(target, centre_, repeats, what);
  }

  Result<TargetReadings> read_target(Target target, std::string_view name) {
    TargetReadings readings;
    VENEER_TRY(session_.show({}, /*lit=*/false));
    VENEER_ASSIGN(
        readings.ambient,
        session_.read(
            target, centre_, options_.repeats, fmt::format("the ambient light on {}", name)));
    VENEER_ASSIGN(readings.black,
                  show_and_read(target, {}, options_.repeats, fmt::format("black on {}", name)));
    for (int channel = 0; channel < 3; ++channel) {
      VENEER_ASSIGN(const Xyz reading,
                    show_and_read(target,
                                  drive(channel, ramp_.back()),
                                  options_.repeats,
                                  fmt::format("full {} on {}", kChannelNames.at(channel), name)));
      readings.full.col(channel) = reading - readings.black;
    }
    return readings;
  }

  Status set_ambient_and_black() {
    // Readings of nothing scatter around zero; what falls under it is noise.
    result_.profile.ambient = white_.ambient.cwiseMax(0.0);
    const Xyz black = white_.black - white_.ambient;
    const double white_luminance = white_.full.row(1).sum();
    if (black.y() < -0.01 * std::abs(white_luminance))
      return fail(
          Errc::kBadFormat,
          "measuring black: it reads {:.3g} cd/m^2, darker than the {:.3g} cd/m^2 with the lamp "
          "off; keep the room's light constant and measure again",
          white_.black.y(),
          white_.ambient.y());
    result_.profile.black = black.cwiseMax(0.0);
    return {};
  }

  Status check_channels() const {
    const Eigen::RowVector3d luminance = white_.full.row(1);
    if (!(luminance.maxCoeff() > 0))
      return fail(
          Errc::kBadFormat,
          "measuring the primaries: no channel gives light above black; check lamp, shutter "
          "and where the colorimeter looks");
    for (int channel = 0; channel < 3; ++channel)
      if (!(white_.full.col(channel).sum() >
            kLeastChannel * white_.full.colwise().sum().maxCoeff()))
        return fail(
            Errc::kBadFormat,
            "measuring the primaries: {} is dead (it adds {:.3g} cd/m^2 at full drive); check "
            "the cable and the projector's colour mode",
            kChannelNames.at(static_cast<std::size_t>(channel)),
            luminance[channel]);
    return {};
  }

  Status measure_ramp(int channel) {
    const std::string_view name = kChannelNames.at(static_cast<std::size_t>(channel));
    std::vector<Xyz> response;
    for (const std::uint16_t code : ramp_) {
      if (code == ramp_.back()) break;  // full drive has been read already
      VENEER_ASSIGN(
          const Xyz reading,
          show_and_read(
              Target::kWhiteReference, drive(channel, code), 1, fmt::format("{} {}", name, code)));
      response.push_back(reading - white_.black);
    }
    response.push_back(white_.full.col(channel));

    // The direction p and the outputs t that make sum |r_i - t_i p|^2 least: p is the principal
    // direction of the readings, which one step of power iteration from full drive gives closely.
    const Xyz start = response.back();
    Xyz weighted = Xyz::Zero();
    for (const Xyz& r : response) weighted += r * r.dot(start);
    const Xyz direction = weighted.normalized();
    std::vector<double> output;
    output.reserve(response.size());
    for (const Xyz& r : response) output.push_back(r.dot(direction));
    const double full = output.back();
    result_.profile.primaries.col(channel) = full * direction;
    VENEER_TRY(set_tone_curve(channel, output));

    double& drift = result_.colour_drift.at(static_cast<std::size_t>(channel));
    for (std::size_t i = 0; i < response.size(); ++i)
      if (output[i] > 0.05 * full)
        drift = std::max(drift, (response[i] - output[i] * direction).norm() / full);
    if (drift > kLargestColourDrift)
      result_.warnings.push_back(fmt::format(
          "the colour of {} drifts by {:.1f} % along its ramp; one matrix cannot follow "
          "that",
          name,
          100 * drift));
    return {};
  }

  Status set_tone_curve(int channel, const std::vector<double>& output) {
    const double full = output.back();
    std::vector<double> codes{0.0};
    std::vector<double> knots{0.0};
    for (std::size_t i = 0; i < output.size(); ++i) {
      codes.push_back(ramp_[i]);
      knots.push_back(output[i] / full);
    }
    std::vector<double> rising = nearest_rising(knots);
    for (std::size_t i = 0; i < knots.size(); ++i)
      if (std::abs(rising[i] - knots[i]) > kLargestFall / 2)  // a fall is shared by two neighbours
        return fail(
            Errc::kBadFormat,
            "measuring the tone curve of {}: it falls near code {}; let the lamp warm up and "
            "switch dynamic contrast off",
            kChannelNames.at(static_cast<std::size_t>(channel)),
            codes[i]);
    for (double& t : rising) t = std::clamp(t, 0.0, 1.0);
    rising.front() = 0.0;
    rising.back() = 1.0;

    const CubicHermite between(std::move(codes), rising, Slopes::kMonotone);
    std::vector<double> curve(std::size_t{1} << options_.bits);
    double highest = 0.0;  // the cubic is monotone up to rounding; this takes the rounding out
    for (std::size_t code = 0; code < curve.size(); ++code) {
      highest = std::clamp(between(static_cast<double>(code)), highest, 1.0);
      curve[code] = highest;
    }
    curve.back() = 1.0;
    result_.profile.tone_curves.at(static_cast<std::size_t>(channel)) = std::move(curve);
    return {};
  }

  Status measure_additivity() {
    const std::uint16_t full = ramp_.back();
    VENEER_ASSIGN(
        const Xyz reading,
        show_and_read(Target::kWhiteReference, {full, full, full}, options_.repeats, "white"));
    const double white = reading.y() - white_.black.y();
    const double sum = white_.full.row(1).sum();
    if (!(white > 0))
      return fail(Errc::kBadFormat, "measuring white: it gives no light above black");
    result_.additivity_error = (sum - white) / white;
    if (std::abs(result_.additivity_error) > kLargestAdditivityError)
      result_.warnings.push_back(fmt::format(
          "the channels are not additive: R + G + B is {:+.1f} % off white; switch colour "
          "boosting off",
          100 * result_.additivity_error));
    return {};
  }

  /// With white still shown. Read on a coarse grid, filled in with cubics along rows, then columns.
  Status measure_vignetting() {
    const ProjectorGeometry& g = result_.profile.geometry;
    const auto spots = [](int count, int extent) {
      std::vector<double> at;
      at.reserve(static_cast<std::size_t>(count));
      for (int i = 0; i < count; ++i)
        at.push_back(std::lerp(kMargin, 1.0 - kMargin, i / (count - 1.0)) * extent);
      return at;
    };
    const std::vector<double> xs = spots(options_.vignetting_columns, g.width);
    const std::vector<double> ys = spots(options_.vignetting_rows, g.height);
    const int width = std::min(kVignettingWidth, g.width);
    const int height = std::min(kVignettingHeight, g.height);

    // The reference is the raster's centre, read in the same run so that lamp drift matters little.
    VENEER_ASSIGN(const double reference, read_fall_off(centre_));
    std::vector<std::vector<double>> columns(static_cast<std::size_t>(width));
    for (const double y : ys) {
      std::vector<double> row;
      for (const double x : xs) {
        VENEER_ASSIGN(const double intensity, read_fall_off({x, y}));
        row.push_back(intensity / reference);
      }
      const CubicHermite along(xs, row, Slopes::kSmooth);
      for (int x = 0; x < width; ++x)
        columns[static_cast<std::size_t>(x)].push_back(along((x + 0.5) / width * g.width));
    }
    result_.profile.vignetting = Image<float>(width, height);
    for (int x = 0; x < width; ++x) {
      const CubicHermite along(ys, columns[static_cast<std::size_t>(x)], Slopes::kSmooth);
      for (int y = 0; y < height; ++y)
        result_.profile.vignetting(x, y) =
            static_cast<float>(std::max(along((y + 0.5) / height * g.height), 1e-3));
    }
    return {};
  }

  Result<double> read_fall_off(const Eigen::Vector2d& pixel) {
    const std::string what = fmt::format("white at pixel {:.0f}, {:.0f}", pixel.x(), pixel.y());
    VENEER_ASSIGN(const Xyz reading, session_.read(Target::kWhiteReference, pixel, 1, what));
    const double light = reading.y() - white_.ambient.y();
    if (!(light > 0))
      return fail(
          Errc::kBadFormat,
          "reading {}: there is no light above the ambient; does the board fill the picture?",
          what);
    return light / std::pow(axis_cosine(result_.profile.geometry, pixel), 3);
  }

  Status set_surface(const TargetReadings& object) {
    ProjectorProfile& profile = result_.profile;
    const Eigen::FullPivLU<Eigen::Matrix3d> white(white_.full);
    if (!white.isInvertible())
      return fail(
          Errc::kBadFormat,
          "measuring the surface: two primaries have the same colour; check the projector's "
          "colour mode");
    profile.surface = object.full * white.inverse();
    const Xyz expected = profile.surface * profile.ambient;
    const double error = (object.ambient - expected).norm();
    // Less light than this, in parts of white, is noise whose ratio says nothing.
    constexpr double kLeastAmbient = 1e-5;
    if (expected.norm() > kLeastAmbient * white_.full.col(1).norm())
      result_.ambient_mismatch = error / expected.norm();
    if (result_.ambient_mismatch > kLargestAmbientMismatch)
      result_.warnings.push_back(
          fmt::format("the ambient light on the object is {:.0f} % off what the white reference "
                      "predicts; shade the object or light it evenly",
                      100 * result_.ambient_mismatch));
    return {};
  }

  Session& session_;
  const RadiometryOptions& options_;
  Eigen::Vector2d centre_;
  std::vector<std::uint16_t> ramp_;
  TargetReadings white_;
  MeasuredProfile result_;
};

}  // namespace

Status RadiometryOptions::check() const {
  const auto in_range = [](std::string_view name, double value, double low, double high) -> Status {
    if (value >= low && value <= high) return {};
    return fail(Errc::kInvalidOption,
                "radiometry: {} is {}; it must be between {} and {}",
                name,
                value,
                low,
                high);
  };
  VENEER_TRY(in_range("bits", bits, 1, 16));
  VENEER_TRY(in_range("reference_distance_m", reference_distance_m, 1e-3, 1e3));
  VENEER_TRY(in_range("levels", levels, std::min(4, (1 << bits) - 1), (1 << bits) - 1));
  VENEER_TRY(in_range("repeats", repeats, 1, 100));
  VENEER_TRY(in_range("vignetting_columns", vignetting_columns, 2, 100));
  return in_range("vignetting_rows", vignetting_rows, 2, 100);
}

std::vector<std::uint16_t> ramp_codes(int bits, int levels) {
  // Equal steps of L* are roughly equal steps of the cube root of the light.
  constexpr double kSpacing = 3.0 / 2.2;
  const int full = (1 << bits) - 1;
  std::vector<std::uint16_t> codes;
  int previous = 0;
  for (int i = 1; i <= levels; ++i) {
    const int wanted =
        static_cast<int>(std::lround(full * std::pow(static_cast<double>(i) / levels, kSpacing)));
    // Rounding may make codes equal in the dark; the rest of the ramp must still fit above.
    previous = std::clamp(wanted, previous + 1, full - (levels - i));
    codes.push_back(static_cast<std::uint16_t>(previous));
  }
  return codes;
}

Xyz predict_reading(const ProjectorProfile& profile,
                    Target target,
                    const Eigen::Vector2d& pixel,
                    const std::array<std::uint16_t, 3>& code,
                    bool lit) {
  Xyz irradiance = profile.ambient;
  if (lit) {
    const Xyz emitted = profile.emitted(profile.linear_drive(code));
    const double slant = std::pow(axis_cosine(profile.geometry, pixel), 3);
    irradiance += slant * profile.vignetting_at(pixel) * (emitted + profile.black);
  }
  if (target == Target::kWhiteReference) return irradiance;
  const Eigen::Vector3d in_primaries = profile.primaries.inverse() * irradiance;
  return profile.surface * profile.primaries *
         profile.reflectance_at(pixel).cwiseProduct(in_primaries);
}

Result<MeasuredProfile> measure_profile(Colorimeter& colorimeter,
                                        PatchDisplay& display,
                                        const ProjectorGeometry& geometry,
                                        const RadiometryOptions& options,
                                        Progress& progress) {
  VENEER_TRY(options.check());
  const int per_target = 5 * options.repeats;  // ambient, black, three channels
  const int readings = 2 * per_target + 3 * (options.levels - 1) + options.repeats + 1 +
                       options.vignetting_columns * options.vignetting_rows;
  progress.start("measuring the projector", readings);
  Session session(colorimeter, display, progress);
  auto measured = Measurement(session, geometry, options).run();
  progress.finish(measured ? fmt::format("{} readings, additivity {:+.2f} %",
                                         measured->readings,
                                         100 * measured->additivity_error)
                           : "failed");
  return measured;
}

}  // namespace veneer::calibration
