// SPDX-License-Identifier: Apache-2.0
#include "capture/development/developer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/statistics.h"
#include "capture/development/internal_developer_state.h"

namespace veneer::capture {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
constexpr double kUsualIndex = 1.5;  // of varnish, plastic, gelatine: for predictions

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

}  // namespace

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
  double all_squares = 0;
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
    all_squares += (parts.specular + parts.diffuse).square().sum();
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
  // What was found of the specular light is its part that is not lost; that is put back, up to all
  // light that there is. A misalignment, of which the mirror shows only the cosine, may have lost
  // more where the plane turns.
  const double turned = std::abs(std::sin(2 * left.azimuth_rad));
  const double q = contrasts.specular.minCoeff();
  const double kept = std::abs(1 - 2 * left.cross_fraction) -
                      (to_unpolarised ? 0 : turned * std::sqrt(std::max(0.0, 1 - q * q)));
  const double all_rms = std::sqrt(all_squares / std::max(1.0, samples));
  const double specular_rms = std::min(findings.specular_rms / std::max(kept, 1e-9),
                                       std::max(all_rms, findings.specular_rms));
  findings.predicted = predicted_error(
      left,
      contrasts,
      specular_rms,
      findings.diffuse_rms,
      std::hypot(findings.specular_noise,
                 findings.resampling * step_between(direction.specular, direction.masked)),
      std::hypot(findings.diffuse_noise,
                 findings.resampling * step_between(direction.diffuse, direction.masked)));
  return direction;
}

}  // namespace veneer::capture
