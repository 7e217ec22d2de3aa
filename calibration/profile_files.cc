// SPDX-License-Identifier: Apache-2.0
#include "calibration/profile_files.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

#include "calibration/exchange/cgats.h"
#include "calibration/exchange/cube.h"
#include "calibration/exchange/gl_projection.h"
#include "calibration/exchange/icc.h"
#include "calibration/exchange/opencv_yaml.h"

namespace veneer::calibration {
namespace {

constexpr int kCubeNodes = 33;
/// Of the GL frustum, in parts of the reference distance: a room around the object.
constexpr double kNear = 0.05;
constexpr double kFar = 20;

/// The drive at which a tone curve gives `t`, linear between codes; the least one of those that
/// give the same.
double drive_of_output(const std::vector<double>& curve, double t) {
  const double last = static_cast<double>(curve.size() - 1);
  const auto above = std::ranges::lower_bound(curve, t);
  if (above == curve.begin()) return 0;
  if (above == curve.end()) return 1;
  const auto upper = static_cast<double>(above - curve.begin());
  const double below = *(above - 1);
  return (upper - 1 + (t - below) / (*above - below)) / last;
}

/// F(d) + k of any drive, linear between codes.
Xyz light_of(const ProjectorProfile& profile, const Eigen::Vector3d& drive) {
  Eigen::Vector3d t;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::vector<double>& curve = profile.tone_curves[c];
    const double at = std::clamp(drive[static_cast<Eigen::Index>(c)], 0.0, 1.0) *
                      static_cast<double>(curve.size() - 1);
    const auto below = std::min(static_cast<std::size_t>(at), curve.size() - 2);
    t[static_cast<Eigen::Index>(c)] =
        std::lerp(curve[below], curve[below + 1], at - static_cast<double>(below));
  }
  return profile.emitted(t) + profile.black;
}

IccSource icc_source(const ProjectorProfile& profile) {
  IccSource source;
  source.tone_curves = profile.tone_curves;
  source.primaries = profile.primaries;
  if (!profile.residual.empty())
    source.forward = [&profile](const Eigen::Vector3d& drive) { return light_of(profile, drive); };
  return source;
}

/// The luminance of the brightest light of sRGB's white that no channel has to exceed full drive
/// for.
double brightest_srgb_white(const ProjectorProfile& profile) {
  const Xyz white = xyz_from_srgb() * Eigen::Vector3d::Ones();
  const DriveCorrection correction(profile.residual);
  const Eigen::Matrix3d linear_from_xyz = profile.primaries.inverse();
  double low = 0;
  double high = 4 * profile.white().y();
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    const Eigen::Vector3d t = correction(linear_from_xyz * (middle * white - profile.black));
    (t.maxCoeff() <= 1.0 ? low : high) = middle;
  }
  return low;
}

}  // namespace

ProfileInverse::ProfileInverse(const ProjectorProfile& profile)
    : profile_(&profile),
      correction_(profile.residual),
      linear_from_xyz_(profile.primaries.inverse()) {}

Eigen::Vector3d ProfileInverse::operator()(const Xyz& xyz) const {
  const Eigen::Vector3d t = correction_(linear_from_xyz_ * (xyz - profile_->black));
  Eigen::Vector3d drive;
  for (std::size_t c = 0; c < 3; ++c)
    drive[static_cast<Eigen::Index>(c)] =
        drive_of_output(profile_->tone_curves[c], t[static_cast<Eigen::Index>(c)]);
  return drive;
}

Status write_profile_files(const ProjectorProfile& profile,
                           std::span<const PatchReading> readings,
                           const std::string& instrument,
                           const std::filesystem::path& folder) {
  VENEER_TRY(write_icc(folder / "projector.icc", icc_source(profile)));
  const ProfileInverse inverse(profile);
  const double white = brightest_srgb_white(profile);
  CubeTable table = CubeTable::sampled(kCubeNodes, [&](const Eigen::Vector3d& rgb) {
    const Eigen::Vector3d linear = rgb.unaryExpr([](double v) { return srgb_decode(v); });
    return inverse(white * (xyz_from_srgb() * linear));
  });
  table.title = "sRGB to projector drive";
  VENEER_TRY(write_cube(folder / "srgb_to_drive.cube", table));
  VENEER_TRY(write_opencv_yaml(folder / "projector.yaml", profile.geometry));
  VENEER_TRY(write_gl_projection(folder / "gl_projection.json",
                                 profile.geometry,
                                 kNear * profile.reference_distance_m,
                                 kFar * profile.reference_distance_m));
  if (readings.empty()) return {};
  return write_ti3(folder / "readings.ti3",
                   {instrument, std::vector<PatchReading>(readings.begin(), readings.end())});
}

}  // namespace veneer::calibration
