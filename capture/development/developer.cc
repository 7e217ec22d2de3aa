// SPDX-License-Identifier: Apache-2.0
#include "capture/development/developer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/statistics.h"
#include "capture/development/internal_captured_light.h"
#include "capture/development/mirror_ball.h"
#include "capture/polarisation/mosaic.h"
#include "capture/polarisation/stokes.h"

namespace veneer::capture {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
constexpr double kUsualIndex = 1.5;         // of varnish, plastic, gelatine: for predictions
constexpr double kMarksMovedWarning = 0.3;  // px: a third of one mixes neighbouring texels

/// The plan's light that is nearest the normal: what the paper calls the reference.
int nearest_to_normal(const btf::DirectionSet& lights) {
  const auto nearest = std::ranges::max_element(lights, {}, [](const auto& l) { return l.z(); });
  return static_cast<int>(nearest - lights.begin());
}

/// Where an angle of the plan is, modulo half a turn; -1 where it is not.
int index_of_angle(std::span<const double> angles_rad, double wanted_rad) {
  constexpr double kSame = 1e-6;
  for (std::size_t i = 0; i < angles_rad.size(); ++i) {
    if (std::abs(std::sin(angles_rad[i] - wanted_rad)) < kSame) return static_cast<int>(i);
  }
  return -1;
}

/// Root mean square difference of texels that lie side by side.
double step_between(const Image<Rgb32f>& part, const Image<std::uint8_t>& masked) {
  double squares = 0;
  double steps = 0;
  for (int y = 0; y < part.height(); ++y) {
    for (int x = 0; x < part.width(); ++x) {
      if (masked(x, y) != 0) continue;
      for (const auto& [u, v] : {std::pair{x + 1, y}, std::pair{x, y + 1}}) {
        if (u >= part.width() || v >= part.height() || masked(u, v) != 0) continue;
        squares += (part(u, v) - part(x, y)).squaredNorm();
        steps += 3;
      }
    }
  }
  return steps > 0 ? std::sqrt(squares / steps) : 0;
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

struct Developer::State {
  const Recording& recording;
  DevelopmentOptions options;
  RigFindings findings;
  std::vector<double> angles_rad;      // of the pictures behind the analyser
  std::optional<StokesSolver> solver;  // where there are more than parallel and cross
  std::vector<PlaneView> white_planes;
  std::vector<Rectifier> on_white, on_sample;  // of each view

  State(const Recording& captured, const DevelopmentOptions& wanted)
      : recording(captured), options(wanted) {}

  [[nodiscard]] const CapturePlan& plan() const { return recording.plan(); }
  [[nodiscard]] Status find_angles();
  [[nodiscard]] Status find_response();
  [[nodiscard]] Status find_noise();
  [[nodiscard]] Status find_planes();
  [[nodiscard]] Status find_lights();
  [[nodiscard]] Status find_leak();

  [[nodiscard]] Result<std::vector<MergedPicture>> light_of(Target target,
                                                            int view,
                                                            int light) const {
    return captured_light(recording, {target, view, light}, findings.response, findings.noise);
  }
  [[nodiscard]] Result<FoundMarks> marks_of(Target target, int view) const;
  [[nodiscard]] Status note_white_range(int view, const Rectifier& rectifier);

  /// Behind one angle of the analyser, in the unit of a sample and halved.
  struct Reading {
    Image<Rgb32f> value, variance;
  };
  struct Texels {
    std::vector<Reading> readings;  // one an angle
    Image<std::uint8_t> masked;
    std::vector<double> saturated;  // of the pixels, one an angle
    double pixels_per_texel = 0;
  };
  [[nodiscard]] Result<Texels> texels_of(Target target, int view, int light) const;
  [[nodiscard]] DevelopedDirection two_pictures(Texels texels) const;
};

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

Result<Developer::State::Texels> Developer::State::texels_of(Target target,
                                                             int view,
                                                             int light) const {
  VENEER_ASSIGN(const std::vector<MergedPicture> pictures, light_of(target, view, light));
  VENEER_ASSIGN(const std::vector<MergedPicture> whites, light_of(Target::kWhite, view, light));
  const std::size_t v = static_cast<std::size_t>(view);
  const Rectifier& rectifier = target == Target::kSample ? on_sample[v] : on_white[v];
  const SampleArea& area = plan().area;
  // The white plate lies flat, so its sample is its reflectance times the cosine of the light.
  const double white_sample =
      plan().white_reflectance *
      std::max(0.0, findings.lights[static_cast<std::size_t>(light)].normalized().z());
  const float scale = static_cast<float>(0.5 * white_sample);

  Texels texels;
  texels.masked = Image<std::uint8_t>(area.columns, area.rows);
  for (std::size_t angle = 0; angle < pictures.size(); ++angle) {
    const RectifiedPicture picture = rectifier.rectify(pictures[angle]);
    const RectifiedPicture white = on_white[v].rectify(whites[angle]);
    Reading reading{Image<Rgb32f>(area.columns, area.rows), Image<Rgb32f>(area.columns, area.rows)};
    for (std::size_t i = 0; i < texels.masked.pixels().size(); ++i) {
      const Eigen::Array3f w = white.light.pixels()[i].array();
      const Eigen::Array3f w_variance = white.variance.pixels()[i].array();
      // Below five deviations nobody can divide by it.
      const bool lit = (w > 0).all() && (w.square() > 25 * w_variance).all();
      if (picture.masked.pixels()[i] != 0 || white.masked.pixels()[i] != 0 || !lit) {
        texels.masked.pixels()[i] = 1;
        continue;
      }
      const Eigen::Array3f value = picture.light.pixels()[i].array() / w;
      reading.value.pixels()[i] = (value * scale).matrix();
      reading.variance.pixels()[i] =
          (scale * scale * (picture.variance.pixels()[i].array() + value.square() * w_variance) /
           w.square())
              .matrix();
    }
    texels.pixels_per_texel = picture.pixels_per_texel;
    texels.saturated.push_back(pictures[angle].saturated_fraction);
    texels.readings.push_back(std::move(reading));
  }
  return texels;
}

DevelopedDirection Developer::State::two_pictures(Texels texels) const {
  DevelopedDirection direction;
  direction.masked = std::move(texels.masked);
  DirectionFindings& findings_here = direction.findings;
  const auto masked = direction.masked.pixels();
  findings_here.masked_fraction =
      static_cast<double>(std::ranges::count_if(masked, [](auto m) { return m != 0; })) /
      static_cast<double>(masked.size());
  if (!solver) {
    const auto p = static_cast<std::size_t>(index_of_angle(angles_rad, 0));
    const auto c = static_cast<std::size_t>(index_of_angle(angles_rad, std::numbers::pi / 2));
    findings_here.saturated_fraction = {texels.saturated[p], texels.saturated[c]};
    direction.parallel = std::move(texels.readings[p].value);
    direction.cross = std::move(texels.readings[c].value);
    // The parts' variances are worked out from these.
    direction.specular_variance = std::move(texels.readings[p].variance);
    direction.diffuse_variance = std::move(texels.readings[c].variance);
    return direction;
  }
  const double most = *std::ranges::max_element(texels.saturated);
  findings_here.saturated_fraction = {most, most};
  const int width = direction.masked.width();
  const int height = direction.masked.height();
  direction.parallel = Image<Rgb32f>(width, height);
  direction.cross = Image<Rgb32f>(width, height);
  direction.specular_variance = Image<Rgb32f>(width, height);
  direction.diffuse_variance = Image<Rgb32f>(width, height);
  std::vector<double> readings(texels.readings.size());
  std::vector<double> variances(texels.readings.size());
  std::vector<double> degrees;
  std::vector<double> angles;
  for (std::size_t i = 0; i < masked.size(); ++i) {
    if (masked[i] != 0) continue;
    for (Eigen::Index k = 0; k < 3; ++k) {
      for (std::size_t a = 0; a < readings.size(); ++a) {
        readings[a] = texels.readings[a].value.pixels()[i][k];
        variances[a] = texels.readings[a].variance.pixels()[i][k];
      }
      const LinearStokes stokes = solver->solve(readings);
      const Eigen::Matrix3d covariance = solver->covariance(variances);
      direction.parallel.pixels()[i][k] = static_cast<float>(0.5 * (stokes[0] + stokes[1]));
      direction.cross.pixels()[i][k] = static_cast<float>(0.5 * (stokes[0] - stokes[1]));
      const double both = covariance(0, 0) + covariance(1, 1);
      direction.specular_variance.pixels()[i][k] =
          static_cast<float>(0.25 * (both + 2 * covariance(0, 1)));
      direction.diffuse_variance.pixels()[i][k] =
          static_cast<float>(0.25 * (both - 2 * covariance(0, 1)));
      if (k == 1) {
        degrees.push_back(degree_of_polarisation(stokes));
        angles.push_back(angle_of_polarisation(stokes));
      }
    }
  }
  findings_here.degree_of_polarisation = quantile(std::move(degrees), 0.5);
  findings_here.angle_of_polarisation_rad = quantile(std::move(angles), 0.5);
  return direction;
}

Developer::Developer(std::unique_ptr<State> state) : state_(std::move(state)) {}
Developer::Developer(Developer&&) noexcept = default;
Developer::~Developer() = default;

const RigFindings& Developer::findings() const { return state_->findings; }
const CapturePlan& Developer::plan() const { return state_->plan(); }

Result<Developer> Developer::create(const Recording& recording,
                                    const DevelopmentOptions& options,
                                    Progress& progress) {
  if (options.index && !(*options.index >= 1 && *options.index <= 4))
    return fail(Errc::kInvalidOption,
                "developing {}: a refractive index of {} is not between 1 and 4",
                recording.folder().string(),
                *options.index);
  auto state = std::make_unique<State>(recording, options);
  constexpr std::array kSteps{&State::find_angles,
                              &State::find_response,
                              &State::find_noise,
                              &State::find_planes,
                              &State::find_lights,
                              &State::find_leak};
  progress.start("reading the rig", kSteps.size());
  for (const auto step : kSteps) {
    VENEER_TRY((state.get()->*step)());
    progress.advance();
  }
  progress.finish(fmt::format("marks to {:.2f} px", state->findings.planes.front().rms_px));
  return Developer(std::move(state));
}

Result<DevelopedDirection> Developer::develop(int view, int light) const {
  const RigFindings& rig = state_->findings;
  VENEER_CHECK(view >= 0 && view < static_cast<int>(rig.views.size()) && light >= 0 &&
               light < static_cast<int>(rig.lights.size()));
  VENEER_ASSIGN(State::Texels texels, state_->texels_of(Target::kSample, view, light));
  const double pixels_per_texel = texels.pixels_per_texel;
  DevelopedDirection direction = state_->two_pictures(std::move(texels));
  direction.view = view;
  direction.light = light;
  DirectionFindings& findings = direction.findings;
  VENEER_ASSIGN(findings.fresnel,
                predict_fresnel(rig.views[static_cast<std::size_t>(view)],
                                rig.lights[static_cast<std::size_t>(light)],
                                plan().polarisation,
                                state_->options.index.value_or(kUsualIndex)));
  const bool to_unpolarised = state_->options.index.has_value();
  const Contrasts contrasts =
      to_unpolarised ? with_turned_plane(rig.contrasts, findings.fresnel) : rig.contrasts;

  const int width = direction.masked.width();
  const int height = direction.masked.height();
  direction.specular = Image<Rgb32f>(width, height);
  direction.diffuse = Image<Rgb32f>(width, height);
  Eigen::Array4d squares = Eigen::Array4d::Zero();  // specular, diffuse, and their noise
  double specular_negative = 0;
  double diffuse_negative = 0;
  double samples = 0;
  double masked = 0;
  for (std::size_t i = 0; i < direction.masked.pixels().size(); ++i) {
    Rgb32f& parallel_variance = direction.specular_variance.pixels()[i];
    Rgb32f& cross_variance = direction.diffuse_variance.pixels()[i];
    if (direction.masked.pixels()[i] != 0) continue;
    Parts parts = separate(direction.parallel.pixels()[i].array().cast<double>(),
                           direction.cross.pixels()[i].array().cast<double>(),
                           parallel_variance.array().cast<double>(),
                           cross_variance.array().cast<double>(),
                           contrasts);
    if (to_unpolarised) {
      const auto unpolarised = unpolarised_specular(parts.specular, findings.fresnel);
      parts.specular = unpolarised.value_or(Eigen::Array3d::Constant(kNoNumber));
      parts.specular_variance /= findings.fresnel.gain * findings.fresnel.gain;
    }
    // What polarisation cannot tell apart is not guessed.
    if (!parts.specular.isFinite().all()) {
      direction.masked.pixels()[i] = 1;
      ++masked;
      continue;
    }
    direction.specular.pixels()[i] = parts.specular.cast<float>().matrix();
    direction.diffuse.pixels()[i] = parts.diffuse.cast<float>().matrix();
    parallel_variance = parts.specular_variance.cast<float>().matrix();
    cross_variance = parts.diffuse_variance.cast<float>().matrix();
    squares += Eigen::Array4d(parts.specular.square().sum(),
                              parts.diffuse.square().sum(),
                              parts.specular_variance.sum(),
                              parts.diffuse_variance.sum());
    specular_negative += static_cast<double>((parts.specular < 0).count());
    diffuse_negative += static_cast<double>((parts.diffuse < 0).count());
    findings.most_negative =
        std::min({findings.most_negative, parts.specular.minCoeff(), parts.diffuse.minCoeff()});
    samples += 3;
  }
  findings.masked_fraction += masked / static_cast<double>(direction.masked.pixels().size());
  const Eigen::Array4d rms = (squares / std::max(1.0, samples)).sqrt();
  findings.specular_rms = rms[0];
  findings.diffuse_rms = rms[1];
  findings.specular_noise = rms[2];
  findings.diffuse_noise = rms[3];
  findings.specular_negative = specular_negative / std::max(1.0, samples);
  findings.diffuse_negative = diffuse_negative / std::max(1.0, samples);
  FresnelPrediction left = findings.fresnel;
  if (to_unpolarised) left.cross_fraction = 0;
  // Texels' edges lie across pixels, and marks are known to a part of one.
  const PlaneView& plane = rig.planes[static_cast<std::size_t>(view)];
  constexpr double kMixedInEdge = 1.0 / 6;  // of a pixel: the mean of f (1 - f) for f in [0, 1]
  findings.resampling =
      2 * std::hypot(plane.rms_px, kMixedInEdge) / std::max(1.0, pixels_per_texel);
  findings.predicted = predicted_error(
      left,
      contrasts,
      findings.specular_rms,
      findings.diffuse_rms,
      std::hypot(findings.specular_noise,
                 findings.resampling * step_between(direction.specular, direction.masked)),
      std::hypot(findings.diffuse_noise,
                 findings.resampling * step_between(direction.diffuse, direction.masked)));
  return direction;
}

}  // namespace veneer::capture
