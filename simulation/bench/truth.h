// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/rigid_transform.h"

namespace veneer::simulation {

/// One channel of the virtual projector.
struct ChannelTruth {
  enum class Tone {
    kPower,   ///< d^exponent
    kSCurve,  ///< (1 + c) d^a / (d^b + c); Kwak and MacDonald 2000, scaled to 1 at full drive
  };
  Tone tone = Tone::kPower;
  double exponent = 2.2;
  double a = 2.6, b = 2.4, c = 0.4;
  double centre_nm = 550;  ///< of the Gaussian primary
  double width_nm = 20;    ///< its standard deviation
  double power = 1;        ///< radiance at the centre relative to the other channels
};

struct ProjectorTruth {
  int width = 640;
  int height = 480;
  int bits = 8;
  Eigen::Vector2d focal_px{1500, 1500};
  Eigen::Vector2d principal_point{320, 240};
  RigidTransform world_from_projector;
  std::array<ChannelTruth, 3> channels;  ///< red, green, blue
  /// Part of each primary's light that has the spectrum of each of the other two. 0 to 0.3.
  double leak = 0;
  /// Part of a channel's light that is lost while both others are at full drive. 0 to 0.3.
  double interaction = 0;
  /// Luminance of a perfect diffuser that faces the lens at the reference distance in the direction
  /// of the raster's centre, at full drive, black not counted.
  double white_nits = 800;
  double reference_distance_m = 1;
  double black_fraction = 0;  ///< luminance of black over that of white
  double black_kelvin = 7000;
  /// Radiant intensity over the raster, relative to its centre:
  /// cos(angle off the axis)^exponent (1 - drop |q - off_centre|^2), q in half diagonals from the
  /// centre.
  double vignetting_exponent = 0;
  double vignetting_drop = 0;
  Eigen::Vector2d vignetting_off_centre{0, 0};
  double blur_px = 0;  ///< standard deviation of the Gaussian point spread
};

struct ObjectTruth {
  std::string mesh = "sphere";  ///< built-in name or file
  std::vector<double> wavelength_nm{550};
  std::vector<double> reflectance{0.8};  ///< of the Lambertian surface, at those wavelengths
};

struct RoomTruth {
  double ambient_nits = 0;  ///< luminance of a perfect diffuser, the same all around
  double ambient_kelvin = 4000;
};

/// A pinhole camera of square pixels that always looks at the object's origin, world +y up.
struct EyeTruth {
  int width = 320;
  int height = 240;
  double vertical_fov_deg = 14;
  int samples = 3;  ///< along each side of a pixel
};

/// The hidden truth of a virtual bench: bench.toml. Nothing that compensates may read it.
/// etc/benches/demo.toml shows every key.
struct BenchTruth {
  ProjectorTruth projector;
  ObjectTruth object;
  RoomTruth room;
  EyeTruth eye;

  /// A mesh file's path is taken relative to the folder of the file.
  /// Errors: kNotFound, kIo, kInvalidOption (unknown or missing key, value out of range).
  [[nodiscard]] static Result<BenchTruth> load(const std::filesystem::path& path);
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

}  // namespace veneer::simulation
