// SPDX-License-Identifier: Apache-2.0
#include "quality/trade/scene_tools.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <system_error>

#include "base/colour.h"
#include "base/files.h"
#include "btf/evaluation.h"
#include "quality/viewpoints.h"
#include "render/renderer.h"

namespace veneer::quality {
namespace {

namespace fs = std::filesystem;

// Of a pixel's side: the crop is looked at, not counted, and has ten times the pixels.
constexpr int kCropRays = 4;
// Half of what a single measurement takes, since drawing is what takes the time: the mean of a
// dithered value over 4 seeds is within 0.38 of a code's step of what was meant, and within 0.13 on
// the root mean square.
constexpr int kDitherSeeds = 4;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Status check_range(std::string_view name, int value, int least, int most) {
  if (value >= least && value <= most) return {};
  return fail(Errc::kInvalidOption,
              "measuring the trade: {} is {}; it must be {} to {}",
              name,
              value,
              least,
              most);
}

/// The middle of what is compared, as the window of the raster that the crop shows.
calibration::ProjectorProfile cropped(const calibration::ProjectorProfile& profile,
                                      std::span<const int> pixels,
                                      const SceneToolsOptions& options) {
  const int width = profile.geometry.width;
  double x = 0;
  double y = 0;
  for (const int pixel : pixels) {
    x += pixel % width;
    y += pixel / width;
  }
  const auto count = static_cast<double>(std::max<std::size_t>(pixels.size(), 1));
  calibration::ProjectorProfile crop = profile;
  auto& g = crop.geometry;
  g.width = std::min(options.crop_width, width);
  g.height = std::min(options.crop_height, profile.geometry.height);
  const int left = std::clamp(static_cast<int>(x / count) - g.width / 2, 0, width - g.width);
  const int top =
      std::clamp(static_cast<int>(y / count) - g.height / 2, 0, profile.geometry.height - g.height);
  g.cx -= left;
  g.cy -= top;
  // What is asked of the surface does not depend on these, which are stretched over the raster.
  crop.vignetting = Image<float>(1, 1, 1.0F);
  crop.surface_map = {};
  return crop;
}

/// FNV-1a (Fowler, Noll, Vo 1991) of 64 bits.
class Fingerprint {
 public:
  void add(std::string_view bytes) {
    for (const char byte : bytes)
      hash_ = (hash_ ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  }
  [[nodiscard]] std::string text() const { return fmt::format("{:016x}", hash_); }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325U;
};

/// "NAME FINGERPRINT" of a file, or of all files of a folder with their names.
Result<std::string> describe(const fs::path& path) {
  std::error_code error;
  std::vector<fs::path> files;
  if (fs::is_directory(path, error)) {
    for (auto at = fs::recursive_directory_iterator(path, error);
         !error && at != fs::recursive_directory_iterator();
         at.increment(error))
      if (at->is_regular_file()) files.push_back(at->path());
    if (error) return fail(Errc::kIo, "reading {}: {}", path.string(), error.message());
    std::ranges::sort(files);
  } else {
    files.push_back(path);
  }
  Fingerprint fingerprint;
  for (const fs::path& file : files) {
    VENEER_ASSIGN(const std::string text, read_text(file));
    fingerprint.add(file.lexically_relative(path).string());
    fingerprint.add(text);
  }
  // A trailing slash leaves an empty last name.
  return fmt::format("{} {}", (path / "").parent_path().filename().string(), fingerprint.text());
}

}  // namespace

Status SceneToolsOptions::check() const {
  VENEER_TRY(check_range("the number of views", views, 1, 64));
  VENEER_TRY(check_range("the number of frames", frames, 3, 10000));
  VENEER_TRY(check_range("the number of pixels", pixels, 1, 1'000'000));
  VENEER_TRY(check_range("the width of a crop", crop_width, 16, 1024));
  return check_range("the height of a crop", crop_height, 16, 1024);
}

struct SceneTools::State {
  render::Scene scene;
  calibration::ProjectorProfile profile;
  const btf::InterpolatedSet& set;
  SceneToolsOptions options;
  ScreenReference reference;
  calibration::ProjectorProfile crop_profile;
  ScreenReference crop_reference;  // every pixel of the crop
  Image<Rgb32f> crop;

  [[nodiscard]] render::FrameInput input(const Viewpoint& from) const {
    return {.eye_in_world = from.eye_in_world, .world_from_object = from.world_from_object};
  }

  [[nodiscard]] Result<Seen> look(const Candidate& candidate, const btf::Material& material) const {
    const render::Level level{&material, candidate.drawing};
    Seen seen;
    VENEER_ASSIGN(seen.errors, measure_on_screen(reference, scene, profile, level));
    VENEER_ASSIGN(const std::unique_ptr<render::Renderer> renderer,
                  render::Renderer::create(scene, std::array{level}, crop_profile, {}));
    renderer->draw(input(crop_reference.viewpoints().front()));
    renderer->finish();
    const auto& g = crop_profile.geometry;
    seen.crop = Image<Rgb32f>(g.width, g.height);
    renderer->read_target(seen.crop.view());
    seen.de00 = Image<float>(g.width, g.height, kNan);
    const Xyz white = profile.white();
    const std::span<const int> pixels = crop_reference.pixels(0);
    const std::span<const Xyz> wanted = crop_reference.wanted(0);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const int x = pixels[i] % g.width;
      const int y = pixels[i] / g.width;
      seen.de00(x, y) = static_cast<float>(delta_e_2000(
          lab_from_xyz(seen.crop(x, y).cast<double>(), white), lab_from_xyz(wanted[i], white)));
    }
    return seen;
  }
};

SceneTools::SceneTools(std::unique_ptr<State> state) : state_(std::move(state)) {}
SceneTools::SceneTools(SceneTools&&) noexcept = default;
SceneTools::~SceneTools() = default;

Result<SceneTools> SceneTools::make(render::Scene scene,
                                    calibration::ProjectorProfile profile,
                                    const btf::InterpolatedSet& set,
                                    const SceneToolsOptions& options,
                                    Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_ASSIGN(std::vector<Viewpoint> viewpoints, viewpoints_of(scene, options.views));
  std::vector<Viewpoint> first{viewpoints.front()};
  ScreenReferenceOptions counted;
  counted.pixels = options.pixels;
  counted.dither_seeds = kDitherSeeds;
  VENEER_ASSIGN(
      ScreenReference reference,
      ScreenReference::make(scene, profile, set, std::move(viewpoints), counted, progress));
  calibration::ProjectorProfile crop_profile = cropped(profile, reference.pixels(0), options);
  const auto& g = crop_profile.geometry;
  const ScreenReferenceOptions all{.pixels = g.width * g.height, .rays = kCropRays};
  VENEER_ASSIGN(ScreenReference crop_reference,
                ScreenReference::make(scene, crop_profile, set, std::move(first), all, progress));
  Image<Rgb32f> crop(g.width, g.height, Rgb32f::Constant(kNan));
  for (std::size_t i = 0; i < crop_reference.pixels(0).size(); ++i)
    crop.pixels()[static_cast<std::size_t>(crop_reference.pixels(0)[i])] =
        crop_reference.wanted(0)[i].cast<float>();
  return SceneTools(std::unique_ptr<State>(new State{.scene = std::move(scene),
                                                     .profile = std::move(profile),
                                                     .set = set,
                                                     .options = options,
                                                     .reference = std::move(reference),
                                                     .crop_profile = std::move(crop_profile),
                                                     .crop_reference = std::move(crop_reference),
                                                     .crop = std::move(crop)}));
}

const Image<Rgb32f>& SceneTools::reference_crop() const { return state_->crop; }
const ScreenReference& SceneTools::reference() const { return state_->reference; }

TradeTools SceneTools::tools() const {
  const State* state = state_.get();
  TradeTools tools;
  tools.fit = [state](const Candidate& candidate,
                      Progress& progress) -> Result<TradeTools::MaterialPtr> {
    VENEER_ASSIGN(const btf::Model* model, btf::find_model(candidate.model));
    VENEER_ASSIGN(std::unique_ptr<btf::Material> material,
                  model->fit(state->set.set(), candidate.fit, progress));
    return TradeTools::MaterialPtr(std::move(material));
  };
  tools.set_errors = [state](const btf::Material& material,
                             Progress& progress) -> Result<SetErrors> {
    VENEER_ASSIGN(const btf::Evaluation e, btf::evaluate(state->set.set(), material, progress));
    return SetErrors{e.encoded.epsilon_avg, e.encoded.rmse, e.de00_mean};
  };
  tools.look = [state](const Candidate& candidate, const btf::Material& material) {
    return state->look(candidate, material);
  };
  tools.time = [state](std::span<const render::NamedLevel> levels, Progress& progress) {
    std::vector<render::FrameInput> inputs;
    for (const Viewpoint& from : state->reference.viewpoints())
      inputs.push_back(state->input(from));
    return render::time_scene(
        state->scene, state->profile, inputs, levels, state->options.frames, progress);
  };
  return tools;
}

Result<std::vector<std::pair<std::string, std::string>>> identity_of(
    const fs::path& set,
    const fs::path& scene,
    const std::string& mesh_name,
    const fs::path& profile,
    const GridOptions& grid,
    const SceneToolsOptions& options) {
  std::vector<std::pair<std::string, std::string>> identity;
  for (const auto& [name, path] : {std::pair<std::string, const fs::path&>{"set", set},
                                   {"scene", scene},
                                   {"profile", profile}}) {
    VENEER_ASSIGN(std::string description, describe(path));
    identity.emplace_back(name, std::move(description));
  }
  std::error_code ignored;
  if (const fs::path mesh = scene.parent_path() / mesh_name; fs::is_regular_file(mesh, ignored)) {
    VENEER_ASSIGN(std::string description, describe(mesh));
    identity.emplace_back("mesh", std::move(description));
  }
  identity.emplace_back("grid", name_of(grid.grid));
  identity.emplace_back(
      "models", grid.models.empty() ? "all" : fmt::format("{}", fmt::join(grid.models, " ")));
  identity.emplace_back("views", std::to_string(options.views));
  identity.emplace_back("frames", std::to_string(options.frames));
  identity.emplace_back("pixels", std::to_string(options.pixels));
  identity.emplace_back("iterations", std::to_string(grid.iterations));
  identity.emplace_back("seed", std::to_string(grid.seed));
  return identity;
}

}  // namespace veneer::quality
