// SPDX-License-Identifier: Apache-2.0
#include "daemon/show.h"

#include <algorithm>
#include <utility>

#include "calibration/profile_store.h"

namespace veneer::daemon {

using service::FaultKind;

Status read_scene(Script& script) {
  VENEER_ASSIGN(script.scene, render::Scene::load(script.config.scene));
  return {};
}

Status read_material(Script& script) {
  VENEER_ASSIGN(std::unique_ptr<btf::Material> material,
                btf::load_material(script.config.material));
  script.material = std::move(material);
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

Show::Show(Script made_of, const PoseFeed& poses, std::unique_ptr<render::Renderer> made)
    : script(std::move(made_of)),
      renderer(std::move(made)),
      observers(poses, script.scene.observer_bodies, script.config.presence),
      object(script.config.presence),
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
