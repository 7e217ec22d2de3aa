// SPDX-License-Identifier: Apache-2.0
#include "quality/screen_reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "base/statistics.h"
#include "render/renderer.h"
#include "render/screen_probe.h"

namespace veneer::quality {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kEncodingExponent = 1.0 / 2.2;  // of the literature's tables

struct Compared {
  std::vector<int> pixels;
  std::vector<Xyz> wanted;
  std::vector<double> geometry;   // G, vignetting included
  std::vector<Matrix3d> surface;  // A of CONVENTIONS: with the map at the pixel
};

// Of differences between two pictures.
class Tally {
 public:
  explicit Tally(const Xyz& white) : white_(white) {}

  void add(const Xyz& shown, const Xyz& wanted) {
    const Vector3d a = encoded(shown);
    const Vector3d b = encoded(wanted);
    sum_ += (a - b).cwiseAbs().sum();
    squares_ += (a - b).squaredNorm();
    de00_.push_back(delta_e_2000(lab_from_xyz(shown, white_), lab_from_xyz(wanted, white_)));
  }

  [[nodiscard]] ScreenError error() const {
    ScreenError error;
    error.pixels = static_cast<std::int64_t>(de00_.size());
    const double values = 3.0 * static_cast<double>(de00_.size());
    error.epsilon = sum_ / values;
    error.rmse = std::sqrt(squares_ / values);
    error.de00_mean = mean(de00_);
    if (!std::isfinite(error.epsilon) || !std::isfinite(error.de00_mean)) {
      error.epsilon = error.rmse = error.de00_mean = error.de00_p95 = error.de00_max =
          std::numeric_limits<double>::quiet_NaN();
      return error;
    }
    error.de00_p95 = quantile(de00_, 0.95);
    error.de00_max = quantile(de00_, 1.0);
    return error;
  }

 private:
  [[nodiscard]] Vector3d encoded(const Xyz& xyz) const {
    // Not a maximum and a minimum: those would make a number of what is none.
    return (srgb_from_xyz() * xyz / white_.y()).unaryExpr([](double v) {
      return std::pow(std::clamp(v, 0.0, 1.0), kEncodingExponent);
    });
  }

  Xyz white_;
  double sum_ = 0;
  double squares_ = 0;
  std::vector<double> de00_;
};

Eigen::Vector2d place_of(int pixel, int width) {
  const int row = pixel / width;
  return {pixel % width + 0.5, row + 0.5};
}

}  // namespace

Status ScreenReferenceOptions::check() const {
  if (pixels < 1 || pixels > 10'000'000)
    return fail(Errc::kInvalidOption,
                "comparing on the screen: {} pixels of each view; 1 to 10000000 can be compared",
                pixels);
  if (rays < 1 || rays > 32)
    return fail(Errc::kInvalidOption,
                "comparing on the screen: {} rays along a pixel's side; 1 to 32 can be cast",
                rays);
  if (dither_seeds < 1 || dither_seeds > 64)
    return fail(Errc::kInvalidOption,
                "comparing on the screen: {} dither seeds of each view; 1 to 64 can be averaged",
                dither_seeds);
  return {};
}

struct ScreenReference::State {
  calibration::ProjectorProfile profile;
  std::vector<Viewpoint> viewpoints;
  std::vector<Compared> compared;  // of each viewpoint
  int dither_seeds = 0;
  Counts counts;

  [[nodiscard]] Compared compare(const render::ProbedScreen& screen,
                                 const btf::InterpolatedSet& set);
  [[nodiscard]] Xyz received(const Compared& at,
                             std::size_t i,
                             std::span<const Image<Rgb16>> codes) const;
};

Compared ScreenReference::State::compare(const render::ProbedScreen& screen,
                                         const btf::InterpolatedSet& set) {
  const double floor = render::RendererOptions{}.geometry_floor;
  Compared at;
  std::vector<render::ScreenQuery> queries;
  counts.at_edges += screen.at_edges;
  counts.unsound += screen.unsound;
  for (const render::ScreenQuery& query : screen.queries) {
    const Eigen::Vector2d place = place_of(query.pixel, profile.geometry.width);
    const double g = query.geometry * profile.vignetting_at(place);
    if (!(g >= floor)) {
      ++counts.out_of_reach;
    } else if (!(query.view.z() > 0.0)) {
      ++counts.unseen;
    } else {
      at.pixels.push_back(query.pixel);
      at.geometry.push_back(g);
      at.surface.push_back(profile.surface * profile.primaries *
                           profile.reflectance_at(place).asDiagonal() *
                           profile.primaries.inverse());
      queries.push_back(query);
    }
  }
  for (const Vector3d& rgb : render::reference_at(set, queries))
    at.wanted.push_back(xyz_from_srgb() * rgb);
  counts.compared += static_cast<std::int64_t>(at.pixels.size());
  return at;
}

Xyz ScreenReference::State::received(const Compared& at,
                                     std::size_t i,
                                     std::span<const Image<Rgb16>> codes) const {
  const int x = at.pixels[i] % profile.geometry.width;
  const int y = at.pixels[i] / profile.geometry.width;
  Xyz emitted = Xyz::Zero();
  for (const Image<Rgb16>& image : codes) {
    const Rgb16& code = image(x, y);
    emitted += profile.emitted(profile.linear_drive({code[0], code[1], code[2]}));
  }
  emitted /= static_cast<double>(codes.size());
  return at.surface[i] * (at.geometry[i] * (emitted + profile.black) + profile.ambient);
}

ScreenReference::ScreenReference(std::unique_ptr<State> state) : state_(std::move(state)) {}
ScreenReference::ScreenReference(ScreenReference&&) noexcept = default;
ScreenReference& ScreenReference::operator=(ScreenReference&&) noexcept = default;
ScreenReference::~ScreenReference() = default;

Result<ScreenReference> ScreenReference::make(const render::Scene& scene,
                                              const calibration::ProjectorProfile& profile,
                                              const btf::InterpolatedSet& set,
                                              std::vector<Viewpoint> viewpoints,
                                              const ScreenReferenceOptions& options,
                                              Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(profile.check());
  if (viewpoints.empty())
    return fail(Errc::kInvalidOption,
                "comparing on the screen: from no viewpoint; give one or more");
  std::vector<render::FrameInput> inputs;
  inputs.reserve(viewpoints.size());
  for (const Viewpoint& viewpoint : viewpoints)
    inputs.push_back({viewpoint.eye_in_world, viewpoint.world_from_object});
  const btf::SampleSetInfo& info = set.set().info();
  VENEER_ASSIGN(
      const std::vector<render::ProbedScreen> screens,
      render::probe_scene(
          scene, profile, inputs, {info.width, info.height, options.pixels, options.rays}));

  auto state = std::make_unique<State>();
  state->profile = profile;
  state->viewpoints = std::move(viewpoints);
  state->dither_seeds = options.dither_seeds;
  progress.start("looking up what is asked", static_cast<std::int64_t>(screens.size()));
  for (const render::ProbedScreen& screen : screens) {
    state->compared.push_back(state->compare(screen, set));
    if (state->compared.back().pixels.empty()) {
      const Viewpoint& from = state->viewpoints[state->compared.size() - 1];
      return fail(
          Errc::kInvalidOption,
          "comparing on the screen: from an eye at ({:.3g}, {:.3g}, {:.3g}) m nothing can be "
          "compared: of {} pixels that the object covers, {} were looked at and are out of the "
          "projector's reach, turned away from the eye or at edges; put the object where the "
          "projector lights it, and the observer's region where it is seen",
          from.eye_in_world.x(),
          from.eye_in_world.y(),
          from.eye_in_world.z(),
          screen.covered,
          screen.at_edges + screen.unsound + static_cast<std::int64_t>(screen.queries.size()));
    }
    progress.advance();
  }
  progress.finish();
  return ScreenReference(std::move(state));
}

std::span<const Viewpoint> ScreenReference::viewpoints() const { return state_->viewpoints; }

int ScreenReference::dither_seeds() const { return state_->dither_seeds; }

const ScreenReference::Counts& ScreenReference::counts() const { return state_->counts; }

std::span<const int> ScreenReference::pixels(std::size_t viewpoint) const {
  return state_->compared[viewpoint].pixels;
}

std::span<const Xyz> ScreenReference::wanted(std::size_t viewpoint) const {
  return state_->compared[viewpoint].wanted;
}

ScreenReference::Frame ScreenReference::frame(std::size_t viewpoint,
                                              const Image<Rgb32f>& target,
                                              std::span<const Image<Rgb16>> codes) const {
  const int width = state_->profile.geometry.width;
  const int height = state_->profile.geometry.height;
  const auto fits = [&](const auto& image) {
    return image.width() == width && image.height() == height;
  };
  VENEER_CHECK(viewpoint < state_->compared.size() && fits(target) && !codes.empty() &&
               std::ranges::all_of(codes, fits));
  const Compared& at = state_->compared[viewpoint];
  Frame frame;
  for (std::size_t i = 0; i < at.pixels.size(); ++i) {
    frame.target.push_back(target(at.pixels[i] % width, at.pixels[i] / width).cast<double>());
    frame.received.push_back(state_->received(at, i, codes));
  }
  return frame;
}

ScreenErrors ScreenReference::errors(std::span<const Frame> frames) const {
  VENEER_CHECK(frames.size() == state_->compared.size());
  const Xyz white = state_->profile.white();
  Tally target(white);
  Tally received(white);
  for (std::size_t v = 0; v < frames.size(); ++v) {
    const std::vector<Xyz>& wanted = state_->compared[v].wanted;
    VENEER_CHECK(frames[v].target.size() == wanted.size() &&
                 frames[v].received.size() == wanted.size());
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      target.add(frames[v].target[i], wanted[i]);
      received.add(frames[v].received[i], wanted[i]);
    }
  }
  return {target.error(), received.error()};
}

Result<ScreenErrors> measure_on_screen(const ScreenReference& reference,
                                       const render::Scene& scene,
                                       const calibration::ProjectorProfile& profile,
                                       const render::Level& level) {
  VENEER_ASSIGN(const std::unique_ptr<render::Renderer> renderer,
                render::Renderer::create(scene, std::array{level}, profile, {}));
  const int width = profile.geometry.width;
  const int height = profile.geometry.height;
  Image<Rgb32f> target(width, height);
  const auto seeds = static_cast<std::uint32_t>(reference.dither_seeds());
  std::vector<Image<Rgb16>> codes(seeds, Image<Rgb16>(width, height));
  std::vector<ScreenReference::Frame> frames;
  for (std::size_t v = 0; v < reference.viewpoints().size(); ++v) {
    const Viewpoint& viewpoint = reference.viewpoints()[v];
    render::FrameInput input{viewpoint.eye_in_world, viewpoint.world_from_object};
    for (; input.dither_seed < seeds; ++input.dither_seed) {
      renderer->draw(input);
      renderer->read_codes(codes[input.dither_seed].view());
    }
    renderer->read_target(target.view());
    frames.push_back(reference.frame(v, target, codes));
  }
  return reference.errors(frames);
}

}  // namespace veneer::quality
