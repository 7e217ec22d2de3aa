// SPDX-License-Identifier: Apache-2.0
#include "daemon/reloader.h"

#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace veneer::daemon {

using service::FaultKind;

namespace {

constexpr Duration kLookInterval = std::chrono::seconds(1);
/// A large material takes a second to read and a renderer one to make, while calls wait.
constexpr Duration kAgain = std::chrono::seconds(3);
/// What a reload takes, as read_all() does: keys, and tables with a dot behind. veneer.toml(5) says
/// so too.
constexpr std::array<std::string_view, 7> kTaken{
    "scene", "material", "profile", "display_latency_ms", "render.", "quality.", "presence."};
/// A rehearsal's, who reads them itself.
constexpr std::array<std::string_view, 2> kNotOurs{"scenario.", "expect"};

bool is_among(const std::string& key, std::span<const std::string_view> names) {
  return std::ranges::any_of(names, [&key](std::string_view name) {
    return name.ends_with('.') ? key.starts_with(name) : key == name;
  });
}

}  // namespace

std::vector<std::string> keys_left_to_a_start(const TomlReader& started, const TomlReader& now) {
  std::vector<std::string> left;
  for (const std::string& key : now.differences(started)) {
    if (is_among(key, kTaken) || is_among(key, kNotOurs)) continue;
    const std::size_t dot = key.find('.');
    left.push_back(dot == std::string::npos
                       ? key
                       : fmt::format("[{}] {}", key.substr(0, dot), key.substr(dot + 1)));
  }
  return left;
}

Result<Config> ConfigFile::read(std::optional<TomlReader>* reader) const {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(path, settings));
  VENEER_ASSIGN(Config config, Config::read(toml));
  VENEER_TRY(toml.finish());
  // On a virtual clock a run is repeatable, so that nothing may come in between.
  config.render.exchangeable = config.clock == ClockKind::kMonotonic;
  if (reader != nullptr) *reader = std::move(toml);
  return config;
}

Reloader::Reloader(
    ConfigFile file, TomlReader started, ShowLoader& loader, Faults& faults, Clock& clock)
    : file_(std::move(file)),
      started_(std::move(started)),
      loader_(loader),
      faults_(faults),
      clock_(clock) {}

// The profile has a watcher of its own; where it is refused, its folder is among them by then.
Reloader::Stamps Reloader::stamps_of(const std::filesystem::path& config, const Script& script) {
  Stamps stamps;
  for (const std::filesystem::path& file :
       {config,
        script.config.scene,
        script.config.material,
        script.config.quality.ladder,
        script.config.scene.parent_path() / script.scene.mesh_name}) {
    stamps[file] = identify(file);
  }
  for (const Script::Rung& rung : script.rungs) stamps[rung.file] = identify(rung.file);
  return stamps;
}

void Reloader::made_of(const Script& script) {
  shown_ = stamps_of(file_.path, script);
  overridden_ = false;
}

Status Reloader::refuse(FaultKind kind, const Error& error) {
  faults_.begin(kind,
                clock_.now(),
                fmt::format("{}; what was read before stays until it is right", error.what));
  return tl::unexpected<Error>(error);
}

// Who asks again is told again; what is tried again by itself is told once.
Status Reloader::reload() {
  warned_of_.clear();
  return read_again();
}

void Reloader::warn_of_the_rest(const TomlReader& now) {
  std::vector<std::string> left = keys_left_to_a_start(started_, now);
  if (std::exchange(warned_of_, left) == left || left.empty()) return;
  spdlog::warn(
      "{}: {} differ{} from what veneerd started with: {} taken at the next start: "
      "systemctl restart veneerd",
      file_.path.string(),
      fmt::join(left, ", "),
      left.size() == 1 ? "s" : "",
      left.size() == 1 ? "it is" : "they are");
}

Status Reloader::read_again() {
  Status status = read_all();
  if (status) {
    refused_.reset();
    for (const FaultKind kind :
         {FaultKind::kConfiguration, FaultKind::kScene, FaultKind::kMaterial, FaultKind::kProfile})
      faults_.end(kind, clock_.now());
  }
  return status;
}

Status Reloader::read_all() {
  again_.reset();
  // Before they are read, so that what comes meanwhile is noticed.
  refused_ = stamps_of(file_.path, loader_.current());
  std::optional<TomlReader> toml;
  const Result<Config> config = file_.read(&toml);
  if (!config) return refuse(FaultKind::kConfiguration, config.error());
  warn_of_the_rest(*toml);
  Script named = loader_.current();
  named.config = *config;
  for (const auto& [file, stamp] : stamps_of(file_.path, named)) (*refused_)[file] = stamp;
  (*refused_)[config->profile / ProfileWatcher::kProfileFile] =
      identify(config->profile / ProfileWatcher::kProfileFile);

  const Config& now = loader_.current().config;
  const bool same_files =
      !overridden_ && now.profile == config->profile && stamps_of(file_.path, named) == shown_;
  if (same_files) {
    // They are what is shown, however the profile turns out.
    for (const FaultKind kind :
         {FaultKind::kConfiguration, FaultKind::kScene, FaultKind::kMaterial})
      faults_.end(kind, clock_.now());
    const Status checked = loader_.check_profile();
    // Its watcher tries again by itself.
    refused_.reset();
    return checked ? checked : refuse(FaultKind::kProfile, checked.error());
  }
  Script next = loader_.current();
  next.config.scene = config->scene;
  next.config.material = config->material;
  next.config.profile = config->profile;
  next.config.render = config->render;
  next.config.drawing = config->drawing;
  next.config.quality = config->quality;
  next.config.presence = config->presence;
  next.config.display_latency_ms = config->display_latency_ms;
  const Stamps stamps = stamps_of(file_.path, named);
  if (const Status read = read_scene(next); !read) return refuse(FaultKind::kScene, read.error());
  if (const Status read = read_material(next); !read)
    return refuse(FaultKind::kMaterial, read.error());
  std::string warning;
  if (const Status read = read_profile(next, &warning); !read)
    return refuse(FaultKind::kProfile, read.error());
  if (!warning.empty()) return refuse(FaultKind::kProfile, Error{Errc::kBadFormat, warning});
  if (const Status fits = render::check_exchangeable(loader_.current().raster(), next.profile);
      !fits)
    return refuse(FaultKind::kProfile, fits.error());
  if (const Status exchanged = loader_.exchange(next); !exchanged) {
    again_ = clock_.now() + kAgain;
    return refuse(FaultKind::kConfiguration, exchanged.error());
  }
  made_of(next);
  return {};
}

void Reloader::look() {
  const Time now = clock_.now();
  if (!refused_ || now < due_) return;
  due_ = now + kLookInterval;
  bool again = again_ && now >= *again_;
  for (const auto& [file, stamp] : *refused_) again |= identify(file) != stamp;
  if (again) (void)read_again();
}

}  // namespace veneer::daemon
