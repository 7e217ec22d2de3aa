// SPDX-License-Identifier: Apache-2.0
#include "calibration/verification.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "base/statistics.h"
#include "calibration/internal_reading_session.h"
#include "calibration/radiometry.h"

namespace veneer::calibration {
namespace {

/// Between 1 % and 3 %, as in colour/additivity.h.
constexpr double kAdditive = 0.02;

double difference(const Xyz& a, const Xyz& b, const Xyz& white) {
  return delta_e_2000(lab_from_xyz(a, white), lab_from_xyz(b, white));
}

/// Of the repeats about their mean, as parts of it.
struct Scatter {
  double squares = 0;  // of (x - mean) / mean, over components that are not dark
  int degrees = 0;     // of freedom
};

class Verification {
 public:
  Verification(ReadingSession& session,
               const ProjectorProfile& profile,
               const VerificationOptions& options)
      : session_(session), profile_(profile), options_(options) {
    result_.white = profile.white();
  }

  Status add(const VerificationPatch& patch) {
    VENEER_TRY(session_.show(patch.code));
    std::vector<Xyz> readings;
    Xyz mean_reading = Xyz::Zero();
    for (int i = 0; i < options_.repeats; ++i) {
      VENEER_ASSIGN(const Xyz reading,
                    session_.read(patch.target, patch.pixel, 1, "a patch of the verification"));
      readings.push_back(reading);
      mean_reading += reading / options_.repeats;
    }
    // A dark reading's scatter is mostly the instrument's own floor and no part of its value.
    if (mean_reading.y() > 0.02 * result_.white.y()) {
      for (int k = 0; k < 3; ++k) {
        // Saturated colours may have next to nothing of one component.
        if (!(mean_reading[k] > 0.02 * result_.white[k])) continue;
        for (const Xyz& reading : readings)
          scatter_.squares += std::pow(reading[k] / mean_reading[k] - 1, 2);
        scatter_.degrees += options_.repeats - 1;
      }
    }
    VerifiedPatch verified{
        patch, mean_reading, predict_reading(profile_, patch.target, patch.pixel, patch.code), 0};
    verified.de00 = difference(verified.read, verified.predicted, result_.white);
    result_.patches.push_back(verified);
    return {};
  }

  Status measure_additivity() {
    const Eigen::Vector2d centre(0.5 * profile_.geometry.width, 0.5 * profile_.geometry.height);
    const auto full = static_cast<std::uint16_t>((1U << static_cast<unsigned>(profile_.bits)) - 1);
    const auto luminance = [&](const Rgb16& code) -> Result<double> {
      VENEER_ASSIGN(const Xyz xyz,
                    session_.show_and_read(Target::kWhiteReference,
                                           centre,
                                           code,
                                           options_.repeats,
                                           "a primary of the verification"));
      return xyz.y();
    };
    VENEER_ASSIGN(const double black, luminance({0, 0, 0}));
    VENEER_ASSIGN(const double red, luminance({full, 0, 0}));
    VENEER_ASSIGN(const double green, luminance({0, full, 0}));
    VENEER_ASSIGN(const double blue, luminance({0, 0, full}));
    VENEER_ASSIGN(const double white, luminance({full, full, full}));
    if (!(white > black))
      return fail(
          Errc::kBadFormat,
          "verifying a profile: white gives no light above black; check lamp, cable and where "
          "the instrument looks");
    result_.additivity_error = (red + green + blue - 3 * black) / (white - black) - 1;
    return {};
  }

  ProfileVerification finish() {
    std::vector<double> de00;
    for (const VerifiedPatch& patch : result_.patches) de00.push_back(patch.de00);
    result_.de00_mean = mean(de00);
    result_.de00_p95 = quantile(de00, 0.95);
    result_.de00_max = quantile(de00, 1.0);
    if (scatter_.degrees > 0)
      result_.relative_noise = std::sqrt(scatter_.squares / scatter_.degrees);
    std::vector<double> of_noise;
    Pcg32 random(1);
    const double left = result_.relative_noise / std::sqrt(options_.repeats);
    for (const VerifiedPatch& patch : result_.patches) {
      Xyz noisy = patch.read;
      for (double& value : noisy) value *= 1.0 + left * random.normal();
      of_noise.push_back(difference(noisy, patch.read, result_.white));
    }
    result_.noise_de00_mean = mean(of_noise);
    result_.noise_de00_p95 = quantile(of_noise, 0.95);
    return std::move(result_);
  }

 private:
  ReadingSession& session_;
  const ProjectorProfile& profile_;
  const VerificationOptions& options_;
  Scatter scatter_;
  ProfileVerification result_;
};

}  // namespace

std::vector<VerificationPatch> verification_patches(const ProjectorProfile& profile,
                                                    int count,
                                                    std::uint64_t seed,
                                                    bool move) {
  Pcg32 random(seed);
  const double codes = std::ldexp(1.0, profile.bits);
  std::vector<VerificationPatch> patches(static_cast<std::size_t>(std::max(count, 0)));
  bool on_object = false;
  for (VerificationPatch& patch : patches) {
    for (std::uint16_t& code : patch.code)
      code = static_cast<std::uint16_t>(codes * random.uniform());
    patch.pixel.x() = profile.geometry.width * std::lerp(0.05, 0.95, random.uniform());
    patch.pixel.y() = profile.geometry.height * std::lerp(0.05, 0.95, random.uniform());
    patch.target = on_object ? Target::kObject : Target::kWhiteReference;
    on_object = !on_object;
    if (!move) patch.pixel = {0.5 * profile.geometry.width, 0.5 * profile.geometry.height};
  }
  if (!move) std::ranges::stable_sort(patches, {}, &VerificationPatch::target);
  return patches;
}

Result<ProfileVerification> verify_profile(Colorimeter& colorimeter,
                                           PatchDisplay& display,
                                           const ProjectorProfile& profile,
                                           const std::vector<VerificationPatch>& patches,
                                           const VerificationOptions& options,
                                           Progress& progress) {
  if (patches.empty())
    return fail(Errc::kInvalidOption, "verifying a profile: there are no patches");
  if (options.repeats < 1 || options.repeats > 100)
    return fail(Errc::kInvalidOption,
                "verifying a profile: repeats is {}; it must be between 1 and 100",
                options.repeats);
  if (const Status valid = profile.check(); !valid)
    return fail_while("verifying a profile", valid.error());
  constexpr std::size_t kOfAdditivity = 5;
  progress.start("verifying the profile",
                 static_cast<std::int64_t>(patches.size() + kOfAdditivity) * options.repeats);
  ReadingSession session(colorimeter, display, progress);
  Verification verification(session, profile, options);
  VENEER_TRY(verification.measure_additivity());
  for (const VerificationPatch& patch : patches) VENEER_TRY(verification.add(patch));
  ProfileVerification result = verification.finish();
  progress.finish(fmt::format("dE00 mean {:.2f}", result.de00_mean));
  return result;
}

Verdict judge(const ProfileVerification& v) {
  const bool additive = std::abs(v.additivity_error) <= kAdditive;
  // A perfect profile's dE00 is that of the noise; what is over it adds as squares do.
  Verdict verdict;
  const double base = additive ? 0.5 : 1.0;
  verdict.gate_mean = std::max(base, 1.5 * v.noise_de00_mean + 0.25 * base);
  verdict.gate_p95 = std::max(2 * base, 1.5 * v.noise_de00_p95 + 0.5 * base);
  verdict.gate_max = 2 * verdict.gate_p95;
  verdict.good = v.de00_mean <= verdict.gate_mean && v.de00_p95 <= verdict.gate_p95 &&
                 v.de00_max <= verdict.gate_max;
  verdict.calibrate_again =
      v.de00_mean > 2 * verdict.gate_mean || v.de00_p95 > 2 * verdict.gate_p95;
  const std::string figures = fmt::format(
      "dE00 {:.2f} mean, {:.2f} at 95 %, {:.2f} at most over {} "
      "patches",
      v.de00_mean,
      v.de00_p95,
      v.de00_max,
      v.patches.size());
  if (verdict.good) {
    verdict.sentence = fmt::format("The profile holds: {}.", figures);
  } else if (verdict.calibrate_again) {
    verdict.sentence = fmt::format(
        "Calibrate again: {}, where {:.2f}, {:.2f} and {:.2f} are to be expected; something has "
        "changed since it was measured, or the instrument does not look where it should.",
        figures,
        verdict.gate_mean,
        verdict.gate_p95,
        verdict.gate_max);
  } else {
    verdict.sentence = fmt::format(
        "The profile is usable but not as good as it should be: {}, where {:.2f}, {:.2f} "
        "and {:.2f} are to be expected; let the lamp warm up and verify once more before "
        "calibrating again.",
        figures,
        verdict.gate_mean,
        verdict.gate_p95,
        verdict.gate_max);
  }
  return verdict;
}

}  // namespace veneer::calibration
