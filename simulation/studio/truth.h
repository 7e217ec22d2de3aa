// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <string>

#include "base/result.h"

namespace veneer::simulation {

/// The hidden truth of a virtual capture studio: studio.toml, whose keys are these names. Nothing
/// that develops its pictures may read it. etc/studios/corrugated.toml shows every key.
struct StudioTruth {
  std::string material = "corrugated";  ///< a height field (simulation/materials), a polarised one
  double tile_mm = 0;                   ///< width of one tile of it; 0: the sample area's width
  std::uint64_t material_seed = 1;
  int samples = 64;    ///< paths a texel and view
  double index = 1.5;  ///< of refraction, for what polarised light does on the interface

  /// Imax / Imin of the projector's polariser; 1: there is none, infinity: a perfect one.
  double light_extinction = 100;
  double analyser_extinction = 100;  ///< the same of the analyser
  double misalignment_deg = 3;       ///< of the analyser from where it is told to be
  double polarised_gain = 1;    ///< of the second angle's picture over the first's: a lamp's drift
  double irradiance = 1;        ///< on a plane facing the light, in parts of what is planned for
  double ambient = 0.01;        ///< unpolarised, from all around, in parts of that
  double light_fall_off = 0.1;  ///< drop of the light from the board's middle to its corner
  /// Standard deviation of the angles, along each of two axes, by which lights miss their places.
  double light_aim_error_deg = 0;

  int width = 640, height = 480;
  double focal_px = 2200;
  Eigen::Vector2d principal_point{320, 240};
  double k1 = 0, k2 = 0;         ///< as of capture::CameraLens
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
  std::uint64_t seed = 1;        ///< of noise, patterns and aims

  /// Errors: kNotFound, kIo, kInvalidOption (unknown key, value out of range).
  [[nodiscard]] static Result<StudioTruth> load(const std::filesystem::path& path);
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

}  // namespace veneer::simulation
