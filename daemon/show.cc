// SPDX-License-Identifier: Apache-2.0
#include "daemon/show.h"

#include <algorithm>
#include <map>
#include <utility>

#include "calibration/profile_store.h"
#include "quality/ladder.h"

namespace veneer::daemon {

using service::FaultKind;

Status read_scene(Script& script) {
  VENEER_ASSIGN(script.scene, render::Scene::load(script.config.scene));
  return {};
}

Status read_material(Script& script) {
  const Config& config = script.config;
  // Rungs may share a material; each is read once.
  std::map<std::filesystem::path, std::shared_ptr<const btf::Material>> materials;
  quality::Ladder ladder;
  if (config.quality.ladder.empty()) {
    VENEER_ASSIGN(std::shared_ptr<const btf::Material> material,
                  btf::load_material(config.material));
    ladder =
        quality::ladder_of(config.material, material->shader().cache.has_value(), config.drawing);
    // What is never drawn takes no memory of the GPU.
    if (config.quality.mode == quality::GovernorMode::kBest) ladder.rungs.resize(1);
    materials[config.material] = std::move(material);
  } else {
    VENEER_ASSIGN(ladder, quality::Ladder::load(config.quality.ladder));
  }
  std::vector<Script::Rung> rungs;
  for (const quality::Rung& rung : ladder.rungs) {
    std::shared_ptr<const btf::Material>& material = materials[rung.material];
    if (material == nullptr) {
      auto loaded = btf::load_material(rung.material);
      if (!loaded)
        return fail_while(fmt::format("reading the ladder's rung {}", rung.name), loaded.error());
      material = *std::move(loaded);
    }
    rungs.push_back({rung.name, rung.ratio, rung.material, material, rung.drawing});
  }
  script.material = rungs.front().material;
  script.rungs = std::move(rungs);
  return {};
}

Status read_profile(Script& script, std::string* warning) {
  // Before it is read, so that one that comes meanwhile is noticed.
  const auto identity = identify(script.config.profile / ProfileWatcher::kProfileFile);
  VENEER_ASSIGN(calibration::ProfileStore::Loaded loaded,
                calibration::ProfileStore(script.config.profile).load_newest_good());
  script.profile = std::move(loaded.profile);
  script.profile_identity = identity;
  if (warning != nullptr) *warning = loaded.warning;
  return {};
}

tl::expected<Script, Refusal> read_script(const Config& config, std::string* warning) {
  Script script;
  script.config = config;
  if (Status status = read_scene(script); !status)
    return tl::unexpected<Refusal>({FaultKind::kScene, std::move(status).error()});
  if (Status status = read_material(script); !status)
    return tl::unexpected<Refusal>({FaultKind::kMaterial, std::move(status).error()});
  if (Status status = read_profile(script, warning); !status)
    return tl::unexpected<Refusal>({FaultKind::kProfile, std::move(status).error()});
  return script;
}

namespace {

quality::Governor governor_of(const Script& script) {
  quality::GovernorOptions options;
  options.mode = script.config.quality.mode;
  options.fixed_rung = static_cast<std::size_t>(script.config.quality.rung);
  std::vector<double> ratios;
  for (const Script::Rung& rung : script.rungs) ratios.push_back(rung.ratio);
  return {options, std::move(ratios)};
}

}  // namespace

Show::Show(Script made_of, const PoseFeed& poses, std::unique_ptr<render::Renderer> made)
    : script(std::move(made_of)),
      renderer(std::move(made)),
      observers(poses, script.scene.observer_bodies, script.config.presence),
      object(script.config.presence),
      governor(governor_of(script)),
      codes(script.raster().width, script.raster().height),
      target(script.raster().width, script.raster().height) {}

std::vector<tracking::BodyId> bodies_of(const render::Scene& scene) {
  std::vector<tracking::BodyId> bodies = scene.observer_bodies;
  if (scene.object_body >= 0) bodies.push_back(scene.object_body);
  std::ranges::sort(bodies);
  bodies.erase(std::unique(bodies.begin(), bodies.end()), bodies.end());
  return bodies;
}

}  // namespace veneer::daemon
