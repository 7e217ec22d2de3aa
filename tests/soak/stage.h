// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "base/result.h"
#include "base/testing/temporary_folder.h"
#include "calibration/profile.h"

namespace veneer::soak {

/// The files of a rehearsal in a folder of their own, and what can happen to them.
///
/// The scene is so bright that without the ceiling the projector would send all that it can.
class Stage {
 public:
  struct Options {
    bool virtual_time = true;
    double frame_rate_hz = 30;
    std::uint64_t frames = 0;   ///< 0: until stopped
    double ceiling_nits = 250;  ///< 0: none
    double tracker_rate_hz = 60;
    int width = 32;
    int height = 24;
  };
  [[nodiscard]] static Result<std::unique_ptr<Stage>> create(const Options& options);

  [[nodiscard]] std::filesystem::path config() const { return at("veneer.toml"); }
  [[nodiscard]] std::filesystem::path scene() const { return at("scene.toml"); }
  [[nodiscard]] std::filesystem::path material() const { return at("material.safetensors"); }
  [[nodiscard]] std::filesystem::path profile() const { return at("profile"); }
  [[nodiscard]] std::filesystem::path state() const { return at("state"); }
  /// Copies that nobody touches.
  [[nodiscard]] std::filesystem::path good_material() const { return at("good/a.safetensors"); }
  [[nodiscard]] std::filesystem::path other_material() const { return at("good/b.safetensors"); }
  [[nodiscard]] std::filesystem::path garbage() const { return at("good/garbage.safetensors"); }
  [[nodiscard]] const calibration::ProjectorProfile& good_profile() const { return good_; }
  [[nodiscard]] const calibration::ProjectorProfile& other_profile() const { return other_; }

  /// What `cp` does to a file that is read while it is written: the first half, in place.
  void cut_material() const;
  void replace_material(const std::filesystem::path& by) const;
  void remove_material() const;
  void damage_profile() const;
  void remove_profile() const;
  void write_profile(const calibration::ProjectorProfile& profile) const;
  void write_scene(const std::string& more = {}) const;
  void remove_scene() const;
  void write_config(const std::string& more = {}) const;
  /// The state folder's place is taken by a file, or is free again.
  void block_state(bool on) const;
  /// All as it was.
  void repair() const;

 private:
  explicit Stage(const Options& options) : options_(options) {}
  [[nodiscard]] std::filesystem::path at(const char* name) const { return folder_.path() / name; }
  [[nodiscard]] Status make_materials() const;

  Options options_;
  TemporaryFolder folder_;
  calibration::ProjectorProfile good_;
  calibration::ProjectorProfile other_;
};

}  // namespace veneer::soak
