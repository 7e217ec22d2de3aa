// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/statistics.h"
#include "capture/development/internal_captured_light.h"
#include "capture/development/internal_developer_state.h"
#include "capture/development/mirror_ball.h"
#include "capture/polarisation/mosaic.h"

namespace veneer::capture {
namespace {

constexpr double kMarksMovedWarning = 0.3;  // px: a third of one mixes neighbouring texels

/// The plan's light that is nearest the normal: what the paper calls the reference.
int nearest_to_normal(const btf::DirectionSet& lights) {
  const auto nearest = std::ranges::max_element(lights, {}, [](const auto& l) { return l.z(); });
  return static_cast<int>(nearest - lights.begin());
}

/// Median distance of the marks that both pictures show.
double moved_px(const FoundMarks& from, const FoundMarks& to) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < from.ids.size(); ++i) {
    const auto same = std::ranges::find(to.ids, from.ids[i]);
    if (same == to.ids.end()) continue;
    distances.push_back(
        (to.pixels[static_cast<std::size_t>(same - to.ids.begin())] - from.pixels[i]).norm());
  }
  return quantile(std::move(distances), 0.5);
}

}  // namespace

int index_of_angle(std::span<const double> angles_rad, double wanted_rad) {
  constexpr double kSame = 1e-6;
  for (std::size_t i = 0; i < angles_rad.size(); ++i) {
    if (std::abs(std::sin(angles_rad[i] - wanted_rad)) < kSame) return static_cast<int>(i);
  }
  return -1;
}

Status Developer::State::find_angles() {
  const std::vector<Shot> shots = recording.shots();
  if (shots.empty())
    return fail(Errc::kNotFound,
                "developing {}: it holds no picture; run veneer capture to take them",
                recording.folder().string());
  VENEER_ASSIGN(const Picture any, recording.picture(shots.front()));
  if (any.mosaic != Mosaic::kNone) {
    angles_rad.assign(mosaic_angles().begin(), mosaic_angles().end());
  } else {
    angles_rad = plan().polarisation.analyser_rad;
  }
  if (angles_rad.size() > 2) {
    VENEER_ASSIGN(solver,
                  StokesSolver::create(angles_rad, std::numeric_limits<double>::infinity()));
  } else if (index_of_angle(angles_rad, 0) < 0 ||
             index_of_angle(angles_rad, std::numbers::pi / 2) < 0) {
    return fail(Errc::kInvalidOption,
                "developing {}: with two angles of the analyser they must be 0 and 90 degrees",
                recording.folder().string());
  }
  return {};
}

Status Developer::State::find_response() {
  findings.response = options.response;
  if (!options.recover) return {};
  // The white target is smooth and bright; the reference light's cross picture has no highlight.
  const Shot shot{Target::kWhite, 0, nearest_to_normal(plan().lights)};
  VENEER_ASSIGN(const CapturedBracket bracket, captured_bracket(recording, shot));
  VENEER_ASSIGN(const RecoveredResponse recovered, recover_response(bracket.lit, *options.recover));
  findings.response = recovered.curve;
  findings.response_residual = recovered.residual;
  return {};
}

Status Developer::State::find_noise() {
  // Some repeated pictures, from dark to bright: more would not make the two numbers better.
  constexpr std::size_t kMostPairs = 6;
  std::vector<Picture> pairs;
  for (const Shot& shot : recording.shots()) {
    if (!shot.repeat || pairs.size() >= 3 * kMostPairs) continue;
    Shot first = shot;
    first.repeat = false;
    if (!recording.has(first)) continue;
    VENEER_ASSIGN(Picture before, recording.picture(first));
    VENEER_ASSIGN(Picture after, recording.picture(shot));
    first.dark = true;
    first.analyser = 0;
    VENEER_ASSIGN(Picture dark, recording.picture(first));
    pairs.push_back(std::move(before));
    pairs.push_back(std::move(after));
    pairs.push_back(std::move(dark));
  }
  if (const Result<NoiseModel> measured = measure_noise(pairs)) {
    findings.noise = *measured;
    findings.noise_was_measured = true;
    return {};
  } else {
    // Nothing but rounding is known then.
    findings.noise = {std::numeric_limits<double>::max(), 1 / std::sqrt(12.0)};
    findings.warnings.push_back("noise is not known: " + measured.error().what);
  }
  return {};
}

Result<FoundMarks> Developer::State::marks_of(Target target, int view) const {
  VENEER_ASSIGN(const std::vector<MergedPicture> pictures,
                light_of(target, view, nearest_to_normal(plan().lights)));
  // The cross picture, or what comes nearest: there no highlight lies on the marks.
  const int cross = index_of_angle(angles_rad, std::numbers::pi / 2);
  return find_marks(pictures[static_cast<std::size_t>(std::max(0, cross))].light, plan().board);
}

Status Developer::State::note_white_range(int view, const Rectifier& rectifier) {
  VENEER_ASSIGN(const std::vector<MergedPicture> pictures,
                light_of(Target::kWhite, view, nearest_to_normal(plan().lights)));
  const RectifiedPicture white = rectifier.rectify(pictures.front());
  std::vector<double> light;
  for (std::size_t i = 0; i < white.masked.pixels().size(); ++i) {
    if (white.masked.pixels()[i] == 0) light.push_back(white.light.pixels()[i].mean());
  }
  // Not the extremes themselves, which noise makes.
  const double dimmest = quantile(light, 0.01);
  if (dimmest > 0)
    findings.white_range = std::max(findings.white_range, quantile(light, 0.99) / dimmest);
  return {};
}

Status Developer::State::find_planes() {
  constexpr std::size_t kLeastViewsForLens = 3;
  const std::size_t views = plan().views.size();
  std::vector<FoundMarks> white_marks;
  std::vector<FoundMarks> sample_marks;
  for (int view = 0; view < static_cast<int>(views); ++view) {
    VENEER_ASSIGN(FoundMarks white, marks_of(Target::kWhite, view));
    VENEER_ASSIGN(FoundMarks sample, marks_of(Target::kSample, view));
    findings.marks_moved_px = std::max(findings.marks_moved_px, moved_px(white, sample));
    white_marks.push_back(std::move(white));
    sample_marks.push_back(std::move(sample));
  }
  if (findings.marks_moved_px > kMarksMovedWarning)
    findings.warnings.push_back(fmt::format(
        "between the white target's pictures and the sample's the marks moved by {:.2f} "
        "pixels: camera or board were touched",
        findings.marks_moved_px));
  if (plan().lens) {
    findings.lens = *plan().lens;
  } else if (views >= kLeastViewsForLens) {
    VENEER_ASSIGN(const std::vector<MergedPicture> any, light_of(Target::kSample, 0, 0));
    VENEER_ASSIGN(
        findings.lens,
        calibrate_lens(sample_marks, any.front().light.width(), any.front().light.height()));
    findings.lens_was_calibrated = true;
  } else {
    return fail(Errc::kInvalidOption,
                "developing {}: the lens is not known and {} views are too few to find it; add "
                "[lens] with focal_px and principal_point to rig.toml, or take at least {} views",
                recording.folder().string(),
                views,
                kLeastViewsForLens);
  }
  for (std::size_t view = 0; view < views; ++view) {
    VENEER_ASSIGN(const PlaneView white,
                  locate_plane(white_marks[view], findings.lens, plan().area));
    VENEER_ASSIGN(const PlaneView sample,
                  locate_plane(sample_marks[view], findings.lens, plan().area));
    VENEER_ASSIGN(const std::vector<MergedPicture> any,
                  light_of(Target::kSample, static_cast<int>(view), 0));
    const int width = any.front().light.width();
    const int height = any.front().light.height();
    on_white.emplace_back(white, plan().area, width, height);
    on_sample.emplace_back(sample, plan().area, width, height);
    VENEER_TRY(note_white_range(static_cast<int>(view), on_white.back()));
    white_planes.push_back(white);
    findings.planes.push_back(sample);
    findings.views.push_back(sample.view_direction);
  }
  return {};
}

Status Developer::State::find_lights() {
  findings.lights = plan().lights;
  if (plan().light_source != LightSource::kMirrorBall) return {};
  for (int light = 0; light < static_cast<int>(plan().lights.size()); ++light) {
    VENEER_ASSIGN(const std::vector<MergedPicture> pictures,
                  light_of(Target::kMirrorBall, 0, light));
    const int parallel = std::max(0, index_of_angle(angles_rad, 0));
    const Result<BallReading> ball = read_mirror_ball(
        pictures[static_cast<std::size_t>(parallel)], white_planes.front(), plan().ball_radius_mm);
    if (!ball)
      return fail(ball.error().code, "light {} on the mirror ball: {}", light, ball.error().what);
    findings.lights[static_cast<std::size_t>(light)] = ball->light;
  }
  return {};
}

Status Developer::State::find_leak() {
  if (!plan().mirror_light) {
    findings.warnings.push_back(
        "there is no mirror in the plan: extinction and misalignment of the polarisers are not "
        "corrected; see [mirror] in rig.toml");
    return {};
  }
  const int light = *plan().mirror_light;
  VENEER_ASSIGN(Texels mirror, texels_of(Target::kMirror, 0, light));
  const DevelopedDirection developed = two_pictures(std::move(mirror));
  std::array<std::vector<double>, 3> contrasts;
  Eigen::Array3d parallel = Eigen::Array3d::Zero();
  Eigen::Array3d cross = Eigen::Array3d::Zero();
  std::size_t texels = 0;
  for (std::size_t i = 0; i < developed.masked.pixels().size(); ++i) {
    if (developed.masked.pixels()[i] != 0) continue;
    const Eigen::Array3d p = developed.parallel.pixels()[i].array().cast<double>();
    const Eigen::Array3d c = developed.cross.pixels()[i].array().cast<double>();
    parallel += p;
    cross += c;
    ++texels;
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (p[k] + c[k] > 0)
        contrasts[static_cast<std::size_t>(k)].push_back((p[k] - c[k]) / (p[k] + c[k]));
    }
  }
  const double count = static_cast<double>(std::max<std::size_t>(1, texels));
  Result<Contrasts> measured = Contrasts::measure(
      parallel / count, cross / count, Eigen::Array3d::Ones(), Eigen::Array3d::Ones());
  if (!measured)
    return fail_while("measuring the polarisers' leak in the mirror", measured.error());
  for (Eigen::Index k = 0; k < 3; ++k) {
    const std::vector<double>& values = contrasts[static_cast<std::size_t>(k)];
    const double mean_value = mean(values);
    double squares = 0;
    for (const double value : values) squares += (value - mean_value) * (value - mean_value);
    const double n = static_cast<double>(values.size());
    measured->specular_deviation[k] = n > 1 ? std::sqrt(squares / (n - 1) / n) : 0;
  }
  findings.measured = *measured;
  findings.leak_was_measured = true;
  if (options.correct_leak) findings.contrasts = *measured;
  return {};
}

}  // namespace veneer::capture
