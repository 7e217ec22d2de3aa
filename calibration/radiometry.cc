// SPDX-License-Identifier: Apache-2.0
#include "calibration/radiometry.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "calibration/colour/baking.h"
#include "calibration/colour/colour_patches.h"
#include "calibration/colour/ramps.h"
#include "calibration/internal_reading_session.h"
#include "calibration/spot_fall_off.h"

namespace veneer::calibration {
namespace {

constexpr std::array<std::string_view, 3> kChannelNames{"red", "green", "blue"};
/// Under this part of the strongest channel's light a channel counts as dead.
constexpr double kLeastChannel = 1e-3;
constexpr double kLargestAmbientMismatch = 0.1;
constexpr double kLargestLampDrift = 0.01;

Eigen::Vector2d raster_centre(const ProjectorGeometry& geometry) {
  return {0.5 * geometry.width, 0.5 * geometry.height};
}

ColourPatchOptions patch_options(const RadiometryOptions& options) {
  ColourPatchOptions patches;
  patches.bits = options.bits;
  patches.ramp_levels = options.levels;
  patches.black_repeats = options.repeats;
  patches.cube = options.cube;
  patches.grey_levels = options.levels;
  return patches;
}

/// Readings of the centre of one target, not corrected for the board's slant.
struct TargetReadings {
  Xyz ambient;
  Xyz black;             // with the ambient light
  Eigen::Matrix3d full;  // columns: each channel at full drive, above black
};

class Measurement {
 public:
  Measurement(ReadingSession& session,
              const ProjectorGeometry& geometry,
              const RadiometryOptions& options)
      : session_(session),
        options_(options),
        patches_(patch_options(options)),
        centre_(raster_centre(geometry)),
        full_(static_cast<std::uint16_t>((1U << static_cast<unsigned>(options.bits)) - 1)) {
    result_.profile.geometry = geometry;
    result_.profile.bits = options.bits;
    result_.profile.reference_distance_m = options.reference_distance_m;
    result_.patch_repeats = options.patch_repeats;
  }

  Result<MeasuredProfile> run() {
    VENEER_ASSIGN(white_, read_target(Target::kWhiteReference, "the white reference"));
    VENEER_TRY(set_ambient_and_black());
    VENEER_TRY(check_channels());
    VENEER_TRY(measure_colour());
    if (options_.known_fall_off.empty()) {
      VENEER_TRY(session_.show({full_, full_, full_}));
      VENEER_ASSIGN(result_.profile.vignetting,
                    read_spot_fall_off(session_,
                                       result_.profile.geometry,
                                       options_.vignetting_columns,
                                       options_.vignetting_rows,
                                       white_.ambient));
    } else {
      result_.profile.vignetting = options_.known_fall_off;
    }
    VENEER_TRY(measure_lamp_drift());
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
  Result<TargetReadings> read_target(Target target, std::string_view name) {
    TargetReadings readings;
    VENEER_TRY(session_.show({}, /*lit=*/false));
    VENEER_ASSIGN(
        readings.ambient,
        session_.read(
            target, centre_, options_.repeats, fmt::format("the ambient light on {}", name)));
    VENEER_ASSIGN(readings.black,
                  session_.show_and_read(
                      target, centre_, {}, options_.repeats, fmt::format("black on {}", name)));
    for (std::size_t channel = 0; channel < 3; ++channel) {
      Rgb16 code{};
      code[channel] = full_;
      VENEER_ASSIGN(
          const Xyz reading,
          session_.show_and_read(target,
                                 centre_,
                                 code,
                                 options_.repeats,
                                 fmt::format("full {} on {}", kChannelNames[channel], name)));
      readings.full.col(static_cast<Eigen::Index>(channel)) = reading - readings.black;
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

  /// Readings of patches of the white board, one each.
  Result<std::vector<PatchReading>> read(const std::vector<Rgb16>& codes, std::string_view what) {
    std::vector<PatchReading> readings;
    for (const Rgb16& code : codes) {
      VENEER_ASSIGN(
          const Xyz xyz,
          session_.show_and_read(Target::kWhiteReference,
                                 centre_,
                                 code,
                                 options_.patch_repeats,
                                 fmt::format("{} {}, {}, {}", what, code[0], code[1], code[2])));
      readings.push_back({drive_of_code(code, options_.bits), xyz});
    }
    result_.patches.insert(result_.patches.end(), readings.begin(), readings.end());
    return readings;
  }

  Status measure_colour() {
    VENEER_ASSIGN(const std::vector<PatchReading> mixtures,
                  read(additivity_patches(patches_), "the mixture"));
    std::vector<Rgb16> codes = ramp_patches(patches_);
    VENEER_ASSIGN(std::vector<PatchReading> fitted, read(codes, "the ramp patch"));
    result_.black = mean_black(fitted);
    VENEER_TRY(check_ramps(fitted));
    VENEER_ASSIGN(result_.additivity, test_additivity(mixtures, result_.black));
    VENEER_TRY(set_additivity_error(mixtures));
    if (!result_.additivity.additive || !result_.additivity.decisive) {
      const std::vector<Rgb16> more = interaction_patches(patches_);
      VENEER_ASSIGN(const std::vector<PatchReading> readings, read(more, "the mixture"));
      fitted.insert(fitted.end(), readings.begin(), readings.end());
      codes.insert(codes.end(), more.begin(), more.end());
    }
    // The mixtures were read for the verdict, and several times: they serve the fit as well, but
    // for a model of separate channels only those that are on its ramps.
    for (const PatchReading& mixture : mixtures) {
      const bool on_a_ramp = (mixture.drive.array() > 0).count() == 1;
      const bool known = std::ranges::any_of(
          fitted, [&](const PatchReading& each) { return each.drive == mixture.drive; });
      if (known || (!on_a_ramp && !result_.additivity.additive)) fitted.push_back(mixture);
    }
    VENEER_ASSIGN(
        const std::vector<PatchReading> held_out,
        read(verification_patches(options_.bits, options_.held_out, codes), "the held-out patch"));
    VENEER_ASSIGN(const SelectedColour selected,
                  select_colour_model(fitted, held_out, result_.black, result_.additivity));
    VENEER_ASSIGN(BakedColour baked, bake(*selected.model, options_.bits));
    result_.profile.tone_curves = std::move(baked.tone_curves);
    result_.profile.primaries = baked.primaries;
    result_.profile.residual = std::move(baked.residual);
    result_.profile.colour_model = selected.model->name();
    result_.candidates = selected.candidates;
    result_.choice = selected.reason;
    const auto chosen =
        std::ranges::find(selected.candidates, selected.model->name(), &ColourCandidate::name);
    VENEER_CHECK(chosen != selected.candidates.end());
    result_.held_out = chosen->held_out;
    std::set<std::tuple<double, double, double>> different;
    for (const PatchReading& each : fitted)
      different.insert({each.drive.x(), each.drive.y(), each.drive.z()});
    result_.fitted_patches = static_cast<int>(different.size());
    set_colour_drift(fitted);
    return {};
  }

  /// The readings of one channel alone above black, by drive.
  [[nodiscard]] std::vector<PatchReading> ramp_of(int channel,
                                                  const std::vector<PatchReading>& readings) const {
    std::vector<PatchReading> ramp;
    for (const PatchReading& each : readings) {
      if ((each.drive.array() > 0).count() != 1 || !(each.drive[channel] > 0)) continue;
      ramp.push_back({each.drive, each.xyz - result_.black});
    }
    std::ranges::stable_sort(
        ramp, {}, [channel](const PatchReading& each) { return each.drive[channel]; });
    return ramp;
  }

  Status check_ramps(const std::vector<PatchReading>& readings) const {
    for (int channel = 0; channel < 3; ++channel) {
      const Xyz full = white_.full.col(channel);
      double highest = 0;
      for (const PatchReading& each : ramp_of(channel, readings)) {
        const double output = each.xyz.dot(full) / full.squaredNorm();
        if (highest - output > kLargestFall)
          return fail(
              Errc::kBadFormat,
              "measuring the tone curve of {}: it falls near code {:.0f}; let the lamp warm up and "
              "switch dynamic contrast off",
              kChannelNames.at(static_cast<std::size_t>(channel)),
              each.drive[channel] * full_);
        highest = std::max(highest, output);
      }
    }
    return {};
  }

  void set_colour_drift(const std::vector<PatchReading>& readings) {
    for (int channel = 0; channel < 3; ++channel) {
      const std::vector<PatchReading> ramp = ramp_of(channel, readings);
      // The principal direction of the readings, which one step of power iteration from full drive
      // gives closely.
      const Xyz start = white_.full.col(channel);
      Xyz weighted = Xyz::Zero();
      for (const PatchReading& each : ramp) weighted += each.xyz * each.xyz.dot(start);
      const Xyz direction = weighted.normalized();
      const double full = start.dot(direction);
      double& drift = result_.colour_drift.at(static_cast<std::size_t>(channel));
      for (const PatchReading& each : ramp) {
        const double output = each.xyz.dot(direction);
        if (output > 0.05 * full)
          drift = std::max(drift, (each.xyz - output * direction).norm() / full);
      }
    }
  }

  Status set_additivity_error(const std::vector<PatchReading>& mixtures) {
    double sum = 0;
    int count = 0;
    for (const PatchReading& each : mixtures) {
      if (!each.drive.isOnes()) continue;
      sum += each.xyz.y() - result_.black.y();
      ++count;
    }
    white_luminance_ = count > 0 ? sum / count : 0;
    if (!(white_luminance_ > 0))
      return fail(Errc::kBadFormat, "measuring white: it gives no light above black");
    result_.additivity_error = (white_.full.row(1).sum() - white_luminance_) / white_luminance_;
    if (!result_.additivity.additive)
      result_.warnings.push_back(fmt::format(
          "{}; switch colour boosting (BrilliantColor, white segment) off if you can, else a "
          "model of mixtures is used",
          result_.additivity.reason));
    return {};
  }

  Status measure_lamp_drift() {
    VENEER_ASSIGN(const Xyz reading,
                  session_.show_and_read(Target::kWhiteReference,
                                         centre_,
                                         {full_, full_, full_},
                                         options_.repeats,
                                         "white at the end"));
    result_.lamp_drift = (reading.y() - result_.black.y()) / white_luminance_ - 1;
    if (std::abs(result_.lamp_drift) > kLargestLampDrift)
      result_.warnings.push_back(fmt::format(
          "white changed by {:+.1f} % while it was measured; let the lamp warm up longer",
          100 * result_.lamp_drift));
    return {};
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

  ReadingSession& session_;
  const RadiometryOptions& options_;
  ColourPatchOptions patches_;
  Eigen::Vector2d centre_;
  std::uint16_t full_;
  TargetReadings white_;
  double white_luminance_ = 0;  // above black
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
  VENEER_TRY(in_range("bits", bits, 4, 16));
  VENEER_TRY(in_range("reference_distance_m", reference_distance_m, 1e-3, 1e3));
  VENEER_TRY(in_range("levels", levels, 4, std::min(40, (1 << bits) - 1)));
  VENEER_TRY(in_range("repeats", repeats, 1, 100));
  VENEER_TRY(in_range("patch_repeats", patch_repeats, 1, 100));
  VENEER_TRY(in_range("held_out", held_out, 8, 1000));
  VENEER_TRY(in_range("cube", cube, 2, 9));
  VENEER_TRY(in_range("vignetting_columns", vignetting_columns, 2, 100));
  VENEER_TRY(in_range("vignetting_rows", vignetting_rows, 2, 100));
  return patch_options(*this).check();
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
  const ColourPatchOptions patches = patch_options(options);
  const int per_target = 5 * options.repeats;  // ambient, black, three channels
  // Those that channels which do not add up need besides are not known yet.
  const auto listed =
      static_cast<int>(additivity_patches(patches).size() + ramp_patches(patches).size());
  const int readings =
      2 * per_target + options.repeats + options.patch_repeats * (options.held_out + listed) +
      (options.known_fall_off.empty() ? 1 + options.vignetting_columns * options.vignetting_rows
                                      : 0);
  progress.start("measuring the projector", readings);
  ReadingSession session(colorimeter, display, progress);
  auto measured = Measurement(session, geometry, options).run();
  progress.finish(measured ? fmt::format("{} readings, additivity {:+.2f} %",
                                         measured->readings,
                                         100 * measured->additivity_error)
                           : "failed");
  return measured;
}

}  // namespace veneer::calibration
