// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/rigid_transform.h"
#include "base/toml_reader.h"
#include "btf/direction.h"

namespace veneer::capture {

/// The board that the sample lies on: ChArUco marks, of which the sample hides some. Board
/// coordinates are millimetres from its top left corner, x right, y down, as seen from the front.
struct MarkBoard {
  int columns = 14;  ///< squares, at least 3
  int rows = 11;     ///< squares, at least 3
  double square_mm = 10;
  double marker_mm = 7;                     ///< side of a marker, less than a square's
  std::string dictionary = "DICT_4X4_100";  ///< OpenCV's name
};

/// The part of the plane that becomes texels. The sample's local frame (docs/CONVENTIONS.md) has x
/// along the board's x, y against its y.
struct SampleArea {
  double left_mm = 0, top_mm = 0;      ///< board coordinates
  double width_mm = 0, height_mm = 0;  ///< above 0
  double lift_mm = 0;           ///< of the sample's mean plane above the marks, towards the camera
  int columns = 64, rows = 64;  ///< texels
};

/// How light and analyser are turned. The projector's polariser passes the field along the unit
/// vector that is nearest to `axis` among those perpendicular to the light's direction; the
/// analyser at angle 0 likewise with the view's. A positive angle turns the analyser's axis
/// counter-clockwise for who looks at the sample from the camera. With the light moved in a plane
/// perpendicular to `axis`, the light is s-polarised.
struct PolarisationAxes {
  Eigen::Vector3d axis{0, 1, 0};  ///< local frame, unit
  /// Angles of the analyser; 0 is parallel, 90 degrees cross.
  std::vector<double> analyser_rad{0, 1.5707963267948966};
};

struct ExposurePlan {
  /// From one exposure of a bracket to the next; 1.5 to 64.
  double step = 4;
  int most = 4;    ///< exposures in a bracket, 1 to 12
  int frames = 4;  ///< pictures that are averaged for one, 1 to 1000
  /// 0: as long as wanted; else exposures are whole multiples of it: the projector's frame, or the
  /// whole colour cycle of a wheel.
  double multiple_of_s = 0;
};

/// A camera's lens: x / z, y / z with radial distortion 1 + k1 r^2 + k2 r^4 to pixels, first centre
/// (0.5, 0.5).
struct CameraLens {
  Eigen::Vector2d focal_px{0, 0};
  Eigen::Vector2d principal_point{0, 0};
  double k1 = 0, k2 = 0;
};

enum class LightSource : std::uint8_t {
  kRig,         ///< `lights` as written
  kMirrorBall,  ///< measured in the ball's highlight; `lights` is what is aimed at
  kProjector,   ///< from the pose in a projector's profile
};

/// What a capture session is to do: the part of rig.toml that `veneer capture` reads.
///
///     [sample]                 # name, columns, rows, left_mm, top_mm, width_mm, height_mm,
///     lift_mm [board]                  # as MarkBoard [polarisation]           # axis,
///     analyser_deg [exposure]               # step, most, frames, multiple_of_s [lights] from =
///     "rig"             # or "mirror-ball", "projector" arc_deg = [-60, 60, 5]   # in the plane of
///     x and normal: first, last, step; positive towards x theta_phi_deg = [[30, 0], [45, 90]]  #
///     or one by one ball_radius_mm = 15      # with "mirror-ball" profile = "PROFILE"      # with
///     "projector": its position in the world of its calibration sample_position = [0, 0, 1.5]    #
///     and where the sample is there, metres, sample_turn_deg = [0, 0, 0]      # and how its local
///     frame is turned: axis times angle [views]                  # arc_deg or theta_phi_deg; the
///     normal where absent [lens]                   # focal_px, principal_point, k1, k2; where
///     absent found from the views [white]                  # reflectance = 0.99 [mirror] # light =
///     12: at which the leak is measured; absent: no mirror
struct CapturePlan {
  std::string name;  ///< of the sample, for the record
  MarkBoard board;
  SampleArea area;
  PolarisationAxes polarisation;
  ExposurePlan exposure;
  LightSource light_source = LightSource::kRig;
  btf::DirectionSet lights;    ///< local frame
  double ball_radius_mm = 15;  ///< with kMirrorBall
  /// With kProjector: name or folder of the profile. Whoever runs the session puts the direction in
  /// `lights`, which are empty until then.
  std::string profile;
  RigidTransform world_from_sample;  ///< of the sample's local frame; with kProjector
  btf::DirectionSet views;           ///< local frame
  std::optional<CameraLens> lens;
  double white_reflectance = 0.99;
  std::optional<int> mirror_light;  ///< index into lights

  /// Reads its tables; the caller calls finish(), which has the mistakes, those of check()
  /// included.
  [[nodiscard]] static CapturePlan read(TomlReader& toml);
  /// Errors: kInvalidOption, naming the key, its value and what it may be.
  [[nodiscard]] Status check() const;
};

}  // namespace veneer::capture
