// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "base/clock.h"
#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"
#include "capture/camera.h"
#include "capture/hands.h"
#include "capture/plan.h"
#include "capture/polariser.h"

namespace veneer::simulation {

/// The hidden truth of a virtual capture studio: studio.toml.
struct StudioTruth {
  std::string material = "corrugated";  ///< a height field (simulation/materials), a polarised one
  double tile_mm = 0;                   ///< width of one tile of it; 0: the material's own
  std::uint64_t material_seed = 1;
  int samples = 64;    ///< paths a texel, view and light
  double index = 1.5;  ///< of refraction, for what polarised light does on the interface

  double light_extinction = 100;     ///< of the projector's polariser; 1: there is none
  double analyser_extinction = 100;  ///< Imax / Imin
  double misalignment_deg = 3;       ///< of the analyser from where it is told to be
  double polarised_gain = 1;    ///< of the second angle's picture over the first's: a lamp's drift
  double irradiance = 1;        ///< on a plane facing the light, in parts of what is planned for
  double ambient = 0.01;        ///< unpolarised, in parts of that
  double light_fall_off = 0.1;  ///< drop of the light from the middle to the board's corner

  int width = 640, height = 480;
  double focal_px = 2200;
  Eigen::Vector2d principal_point{320, 240};
  double k1 = 0, k2 = 0;
  double distance_mm = 800;      ///< of the camera from the sample's middle
  double full_well = 20000;      ///< electrons
  double read_noise = 4;         ///< electrons, standard deviation
  double dark_current = 2;       ///< electrons a second
  double fixed_pattern = 0.005;  ///< of the pixels' gains, standard deviation
  double offset_counts = 16;     ///< added to every pixel, with a pattern of its own
  double vignetting = 0.3;       ///< loss of light in the picture's corners
  double response_gamma = 1;     ///< counts go by light^(1 / gamma)
  int bits = 12;                 ///< 8 to 16
  bool mosaic = false;           ///< analysers on the sensor, in place of one that turns
  double dropped = 0;            ///< part of grabs that time out
  double repeated = 0;           ///< part of grabs that give the picture before once more
  std::uint64_t seed = 1;

  /// Errors: kNotFound, kInvalidOption.
  [[nodiscard]] static Result<StudioTruth> load(const std::filesystem::path& path);
  [[nodiscard]] Status check() const;
};

/// A virtual capture studio: sample, marks, projector and camera with their polarisers. Fields of
/// light are followed as Jones vectors, incoherent parts added; it shares no code with
/// capture/polarisation, which it judges. The same for the same seeds. One thread.
class VirtualStudio {
 public:
  /// Path-traces the sample for the plan's directions (kept in `cache`, if that is not empty).
  /// Errors: kInvalidOption, kIo.
  [[nodiscard]] static Result<std::unique_ptr<VirtualStudio>> create(
      const StudioTruth& truth,
      const capture::CapturePlan& plan,
      const std::filesystem::path& cache,
      Progress& progress);
  ~VirtualStudio();

  [[nodiscard]] capture::Camera& camera();
  [[nodiscard]] capture::Polariser* polariser();  ///< null with a mosaic
  [[nodiscard]] capture::Hands& hands();
  [[nodiscard]] Clock& clock();  ///< virtual; exposures and hands take their time

  /// What a perfect capture would give at the plan's texels: unit of a sample set.
  struct TexelTruth {
    Image<Rgb32f> specular;  ///< all specular light under the rig's polarised light
    Image<Rgb32f> diffuse;
    Image<Rgb32f> unpolarised_specular;
  };
  [[nodiscard]] TexelTruth truth(int view, int light) const;

 private:
  struct State;
  explicit VirtualStudio(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::simulation
