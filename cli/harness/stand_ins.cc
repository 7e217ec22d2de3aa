// SPDX-License-Identifier: Apache-2.0
#include "cli/harness/stand_ins.h"

#include <cmath>
#include <numbers>

#include "base/colour.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "calibration/profile.h"
#include "cli/programs.h"
#include "simulation/materials/phong_texture.h"

namespace veneer::cli {

namespace fs = std::filesystem;

Status make_stand_in_material(const fs::path& path, Progress& progress) {
  if (is_up_to_date(path) && btf::load_material(path)) return {};
  const fs::path set_path = path.parent_path() / "phong.btfset";
  simulation::SynthesisOptions options;
  options.size = 16;
  VENEER_TRY(simulation::synthesize_phong(set_path, options, progress));
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(set_path));
  VENEER_ASSIGN(const btf::Model* model, btf::find_model("phong"));
  VENEER_ASSIGN(const auto material, model->fit(set, {}, progress));
  return btf::save_material(*material, path, {});
}

Status make_stand_in_profile(const fs::path& path, int width, int height) {
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
  constexpr double kWhite_nits = 800;
  profile.primaries = kWhite_nits * xyz_from_srgb();
  profile.black = Xyz(0.8, 0.8, 0.8);
  profile.reference_distance_m = 1.2;
  profile.vignetting = Image<float>(1, 1);
  profile.vignetting(0, 0) = 1;
  return profile.save(path);
}

}  // namespace veneer::cli
