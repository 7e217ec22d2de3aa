// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
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
  /// Part of a channel's luminance that has, at the bottom of its ramp, the chromaticity of the
  /// other two channels together; it falls linearly with the drive and is gone at full. 0 to 0.3.
  double chromaticity_drift = 0;
  /// Part of white's luminance that comes from a clear segment, which is driven by the least of the
  /// channels' linear drives, raised to an exponent (1 to 4). 0 to 0.6.
  double white_segment = 0;
  double white_segment_exponent = 1;
  double white_segment_kelvin = 7500;
  /// Part by which the lamp falls short of its settled light when it is switched on, and the time
  /// constant with which that passes. 0 to 0.3.
  double lamp_drift = 0;
  double lamp_settling_s = 300;
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
  /// What is painted on it, over uv: fields of `reflectance`, which has the one at uv = 0, and of
  /// `texture_reflectance` by turns.
  enum class Texture {
    kNone,
    kChecks,
    kStripes,  ///< along v
  };
  Texture texture = Texture::kNone;
  double texture_fields = 8;                ///< along u, and of checks along v. 1 to 1000.
  std::vector<double> texture_reflectance;  ///< one for each wavelength; empty without a texture

  /// Whether a point of the surface has `texture_reflectance`.
  [[nodiscard]] bool painted(const Eigen::Vector2d& uv) const;
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

/// A colorimeter: what it gives for the light L is (I + matrix_error) L (1 + drift_per_hour t),
/// with noise.
struct InstrumentTruth {
  double relative_noise = 0.003;   ///< standard deviation of each of X, Y, Z, in parts of it
  double dark_noise_nits = 0.002;  ///< standard deviation of each of X, Y, Z in the dark
  double drift_per_hour = 0;       ///< of its gain, in parts
  Eigen::Matrix3d matrix_error = Eigen::Matrix3d::Zero();  ///< in XYZ
  std::uint64_t seed = 1;
};

struct TrackerTruth {
  double position_noise_m = 0.0002;  ///< standard deviation along each axis
  double rotation_noise_deg = 0.02;  ///< standard deviation about each axis
  std::uint64_t seed = 1;
};

/// A colour camera of linear response whose lens blurs by a pixel, with radial distortion: a ray of
/// slope s (x / z, y / z) falls on focal_px s (1 + k1 |s|^2 + k2 |s|^4) + principal_point.
struct CameraTruth {
  int width = 1280;
  int height = 960;
  double focal_px = 4200;
  Eigen::Vector2d principal_point{640, 480};
  double k1 = 0;
  double k2 = 0;
  RigidTransform world_from_camera;
  /// Electrons of a pixel's channel per cd/m^2 of an equal-energy light and second of exposure.
  double sensitivity = 2000;
  double full_well = 10000;  ///< electrons
  double read_noise = 4;     ///< standard deviation, electrons
  int bits = 12;             ///< full scale is the full well
  double least_exposure_s = 1e-4;
  double most_exposure_s = 1;
  int samples = 3;  ///< its square is the number of rays of a pixel
  std::uint64_t seed = 1;
};

/// A chequered board for camera and projector. Its frame: origin at the first inner corner, x along
/// the columns, y along the rows, z into the board away from who looks at it.
struct BoardTruth {
  int columns = 9;  ///< of inner corners
  int rows = 6;
  double square_m = 0.017;
  double border_m = 0.01;  ///< white, around the squares
  double white = 0.85;     ///< reflectance, Lambertian, the same at all wavelengths
  double black = 0.05;
  /// Places at which a person would hold it: tilted all around, near and far, wholly within what
  /// projector and camera see. Made from the seed. 3 to 100.
  int poses = 10;
  double tilt_deg = 28;
  std::uint64_t seed = 1;
  RigidTransform board_from_sensor;  ///< the tracked sensor that is fixed to the board
};

/// The hidden truth of a virtual bench: bench.toml. Nothing that compensates may read it.
/// etc/benches/demo.toml shows every key.
struct BenchTruth {
  ProjectorTruth projector;
  ObjectTruth object;
  RoomTruth room;
  EyeTruth eye;
  InstrumentTruth instrument;
  TrackerTruth tracker;
  std::optional<CameraTruth> camera;  ///< both or none
  std::optional<BoardTruth> board;

  /// A mesh file's path is taken relative to the folder of the file.
  /// Errors: kNotFound, kIo, kInvalidOption (unknown or missing key, value out of range).
  [[nodiscard]] static Result<BenchTruth> load(const std::filesystem::path& path);
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

}  // namespace veneer::simulation
