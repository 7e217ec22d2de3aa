// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "base/scanout.h"
#include "btf/material.h"
#include "calibration/profile.h"
#include "daemon/config.h"
#include "daemon/devices.h"
#include "daemon/file_identity.h"
#include "daemon/observers.h"
#include "daemon/pose_feed.h"
#include "daemon/profile_watcher.h"
#include "quality/governor.h"
#include "render/prepared_profile.h"
#include "render/renderer.h"
#include "render/scene.h"
#include "service/status.h"
#include "tracking/presence.h"

namespace veneer::daemon {

/// What a show is made of, as it was read: nothing of the GPU. A copy with one part exchanged is
/// another script.
struct Script {
  Config config;
  render::Scene scene;
  /// Shared by the scripts that have it in common: it may be as large as half the memory.
  std::shared_ptr<const btf::Material> material;
  /// The ways in which it is drawn, best first, at least one: those of the ladder, which has
  /// materials of its own, or what can be taken off the one material.
  struct Rung {
    std::string name;
    double ratio = 1;  ///< of costs
    std::filesystem::path file;
    std::shared_ptr<const btf::Material> material;
    render::DrawingOptions drawing;
  };
  std::vector<Rung> rungs;
  calibration::ProjectorProfile profile;
  std::optional<FileIdentity> profile_identity;  ///< before it was read

  [[nodiscard]] render::RasterFormat raster() const {
    return {profile.geometry.width, profile.geometry.height, profile.bits};
  }
};

/// An error, and what it is about.
struct Refusal {
  service::FaultKind kind = service::FaultKind::kConfiguration;
  Error error;
};

/// Reads what a configuration names. `warning` says so where an older profile was taken.
/// Errors: those of every part.
[[nodiscard]] tl::expected<Script, Refusal> read_script(const Config& config, std::string* warning);
/// Parts of it.
[[nodiscard]] Status read_scene(Script& script);
[[nodiscard]] Status read_material(Script& script);
[[nodiscard]] Status read_profile(Script& script, std::string* warning);

/// Counts those that may draw into a display's buffers.
struct ScanoutUse {
  void operator()(std::atomic<int>* users) const { --*users; }
};

/// Everything that frames are drawn with, made by a thread that may take its time and then owned by
/// the frame loop.
struct Show {
  /// @param poses  borrowed.
  Show(Script script, const PoseFeed& poses, std::unique_ptr<render::Renderer> renderer);

  Script script;
  const Scanout* scanout = nullptr;  ///< the buffers that the renderer draws into; null: none
  const Scanout* refused = nullptr;  ///< those that the renderer could not draw into
  std::unique_ptr<std::atomic<int>, ScanoutUse> scanout_use;  // before the renderer: it goes later
  std::unique_ptr<render::Renderer> renderer;                 ///< null once its display has gone
  bool lost = false;                                          ///< its GPU was reset
  std::string description;                                    ///< the renderer's
  Observers observers;
  tracking::PresenceFilter object;
  quality::Governor governor;
  Image<Rgb16> codes;
  Image<Rgb32f> target;
  std::unique_ptr<ProfileWatcher> profiles;  ///< null where the profile stays
};

/// The bodies whose poses a scene needs, sorted, each once.
[[nodiscard]] std::vector<tracking::BodyId> bodies_of(const render::Scene& scene);

}  // namespace veneer::daemon
