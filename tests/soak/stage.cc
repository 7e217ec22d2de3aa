// SPDX-License-Identifier: Apache-2.0
#include "tests/soak/stage.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "base/files.h"
#include "btf/material.h"
#include "simulation/materials/phong_texture.h"

namespace veneer::soak {
namespace {

namespace fs = std::filesystem;

constexpr double kWhite_nits = 800;

/// A projector as a book has it, 1.2 m in front of the object.
calibration::ProjectorProfile ideal_profile(int width, int height) {
  calibration::ProjectorProfile profile;
  calibration::ProjectorGeometry& geometry = profile.geometry;
  geometry.width = width;
  geometry.height = height;
  geometry.fx = geometry.fy = 4.0 * width;
  geometry.cx = 0.5 * width;
  geometry.cy = 0.5 * height;
  // It stands at z = 1.2 and looks along -z; its x is the world's, its y points down.
  geometry.world_from_projector.translation = {0, 0, 1.2};
  geometry.world_from_projector.rotation =
      Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX());
  for (std::vector<double>& curve : profile.tone_curves) {
    for (int code = 0; code < 256; ++code) curve.push_back(std::pow(code / 255.0, 2.2));
  }
  profile.primaries = kWhite_nits * xyz_from_srgb();
  profile.black = Xyz(0.8, 0.8, 0.8);
  profile.reference_distance_m = 1.2;
  profile.vignetting = Image<float>(1, 1);
  profile.vignetting(0, 0) = 1;
  return profile;
}

// The rehearsal goes on whatever the disk says; what it then lacks is found by what is checked.
void write(const fs::path& path, const std::string& text) {
  VENEER_CHECK(write_text(path, text).has_value());
}

}  // namespace

Result<std::unique_ptr<Stage>> Stage::create(const Options& options) {
  std::unique_ptr<Stage> stage(new Stage(options));
  fs::create_directories(stage->state());
  fs::create_directories(stage->at("good"));
  stage->good_ = ideal_profile(options.width, options.height);
  // Another lamp: half the light, and a tone curve of its own.
  stage->other_ = stage->good_;
  stage->other_.primaries *= 0.5;
  for (std::vector<double>& curve : stage->other_.tone_curves) {
    for (std::size_t code = 0; code < curve.size(); ++code)
      curve[code] = std::pow(static_cast<double>(code) / 255.0, 1.8);
  }
  VENEER_TRY(stage->make_materials());
  stage->repair();
  return stage;
}

Status Stage::make_materials() const {
  SilentProgress silent;
  for (const auto& [path, seed] :
       {std::pair{good_material(), 1U}, std::pair{other_material(), 2U}}) {
    const fs::path set_path = at("good/phong.btfset");
    fs::remove_all(set_path);
    simulation::SynthesisOptions options;
    options.size = 8;
    options.seed = seed;
    VENEER_TRY(simulation::synthesize_phong(set_path, options, silent));
    VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(set_path));
    VENEER_ASSIGN(const btf::Model* model, btf::find_model("phong"));
    VENEER_ASSIGN(const auto material, model->fit(set, {}, silent));
    VENEER_TRY(btf::save_material(*material, path, {}));
  }
  return write_text(garbage(), std::string(4096, '\xa5'));
}

void Stage::cut_material() const {
  const auto size = fs::file_size(good_material());
  fs::copy_file(good_material(), material(), fs::copy_options::overwrite_existing);
  fs::resize_file(material(), size / 2);
}

void Stage::replace_material(const fs::path& by) const {
  const fs::path beside = at("material.new");
  fs::copy_file(by, beside, fs::copy_options::overwrite_existing);
  fs::rename(beside, material());
}

void Stage::remove_material() const { fs::remove(material()); }

void Stage::damage_profile() const { write(profile() / "profile.json", "{\"version\": 3, "); }

void Stage::remove_profile() const { fs::remove_all(profile()); }

void Stage::write_profile(const calibration::ProjectorProfile& profile) const {
  VENEER_CHECK(profile.save(this->profile()).has_value());
}

void Stage::write_scene(const std::string& more) const {
  write(scene(), R"(mesh = "sphere"
texture_repeats = [6.0, 3.0]
[observer]
tracker_body = 0
[[light]]
kind = "directional"
direction = [0.1, 0.3, 1.0]
illuminance_lux = 20000
)" + more);
}

void Stage::remove_scene() const { fs::remove(scene()); }

void Stage::write_config(const std::string& more) const {
  write(config(),
        fmt::format(R"(scene = "scene.toml"
material = "material.safetensors"
profile = "profile"
state_directory = "state"
clock = "{}"
frame_rate_hz = {}
frames = {}
{}
[render]
luminance_ceiling = {}
[control]
driver = "dlpc350"
poll_s = 1
[tracker]
driver = "simulated"
rate_hz = {}
latency_ms = 4
noise_position_mm = 0.2
[[tracker.path]]
body = 0
kind = "walk"
centre = [0.0, 0.0, 0.0]
radius_m = 0.9
height_m = 0.2
from_deg = -25
to_deg = 45
period_s = 8
[output]
driver = "null"
)",
                    options_.virtual_time ? "virtual" : "monotonic",
                    options_.frame_rate_hz,
                    options_.frames,
                    more,
                    options_.ceiling_nits,
                    options_.tracker_rate_hz));
}

void Stage::block_state(bool on) const {
  fs::remove_all(state());
  if (on) {
    write(state(), "in the way");
  } else {
    fs::create_directories(state());
  }
}

void Stage::repair() const {
  replace_material(good_material());
  write_profile(good_);
  write_scene();
  write_config();
  block_state(false);
}

}  // namespace veneer::soak
