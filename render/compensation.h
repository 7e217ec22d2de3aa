// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>

#include "base/colour.h"
#include "calibration/drive_correction.h"
#include "calibration/profile.h"
#include "render/luminance_ceiling.h"
#include "render/renderer.h"
#include "render/tone_levels.h"

namespace veneer::render {

/// What became of a pixel. The numbers are those that the shader stores.
enum class PixelState : std::uint8_t {
  kNotCovered = 0,
  kInGamut = 1,
  kOutOfGamut = 2,
  kOutOfReach = 3
};

struct CompensatedPixel {
  PixelState state = PixelState::kNotCovered;
  Eigen::Vector3d drive = Eigen::Vector3d::Zero();  ///< t (tau), linear, in [0, 1]
  double gamut_loss = 0;                            ///< dE in IPT x 100 that gamut mapping made
  bool held = false;                                ///< brought down to the luminance ceiling
  std::array<std::uint16_t, 3> codes{};
};

/// A drive may be this far outside [0, 1] before it counts as out of gamut; it is clamped there.
/// One step of the half floats in which the target is drawn, at full drive.
inline constexpr double kGamutTolerance = 0x1p-11;
/// Halvings in the search for the reachable chroma: it is found to one part in 4096 of the
/// target's, far below a step of the codes.
inline constexpr int kGamutSteps = 12;

/// Compensation in double precision: what shaders/compensate.frag does, pixel by pixel.
///
/// With the model of ProjectorProfile, t* = (M^-1 A^-1 L / s - M^-1 E) / G - M^-1 k, where s
/// divides each primary's component by the surface's reflectance for it at this pixel. t is t*, or
/// where the profile has a colour residual, DriveCorrection's tau for it. Where a component of t is
/// outside [0, 1] (over white, over a primary, under black and ambient), the target is moved in
/// IPT, relative to the profile's white, on a straight line to a point of the achromatic axis, as
/// little as brings it into reach: hue is kept exactly. That point's lightness is the target's,
/// kept within the middle half of the neutrals that this pixel can show, so that a bright colour
/// loses some lightness and some chroma instead of turning white. Where no neutral can be shown at
/// all (a strongly coloured surface in strong ambient light) t is clamped and hue is lost. With a
/// residual, the ends of the neutrals are searched for as the chroma is, and the loss of a clamped
/// t is counted with the residual of the unclamped one. The codes bracket t in linear light; dither
/// picks one of the two (dither.h), or the nearer one without dither.
///
/// Without RendererOptions::compensate, t is linear sRGB of the target over the luminance of full
/// drive without black,
/// cut to [0, 1], and the codes are its sRGB encoding: what is shown by someone who knows nothing
/// of the projector or the surface.
///
/// With RendererOptions::luminance_ceiling, what has gone through all this is held under it: where
/// the upper of the bracketing codes send too much, all that is sent above black is scaled down by
/// one factor, so that its hue stays, until they do not; dither then chooses as ever. Where even
/// the least that is not black is too much, all is off. That the codes are allowed is asked last of
/// all, of the codes themselves; should dither have mixed a pair that a residual makes brighter
/// than the upper codes, those are taken.
///
/// A target or geometry that is not finite, and G below the floor, are out of reach: drive 0.
class Compensation {
 public:
  /// @param profile  must pass check().
  Compensation(const calibration::ProjectorProfile& profile, const RendererOptions& options);

  /// @param target  XYZ in cd/m^2.
  /// @param geometry  cos(theta_p) (r_ref / r)^2; <= 0 is not covered.
  /// @param vignetting  at this pixel.
  /// @param reflectance  s at this pixel, see ProjectorProfile::surface_map.
  [[nodiscard]] CompensatedPixel pixel(const Xyz& target,
                                       double geometry,
                                       double vignetting,
                                       const Eigen::Vector3d& reflectance,
                                       std::uint32_t x,
                                       std::uint32_t y,
                                       std::uint32_t dither_seed) const;

  /// What the solution is made of; the shader gets the same numbers in single precision.
  struct Constants {
    bool compensate = true;
    bool dither = true;
    double geometry_floor = 0;
    Eigen::Matrix3d drive_from_target;  ///< M^-1 A^-1
    Eigen::Vector3d drive_of_ambient;   ///< M^-1 E
    Eigen::Vector3d drive_of_black;     ///< M^-1 k
    Eigen::Matrix3d cones_from_target;  ///< relative to the white's
    Eigen::Matrix3d drive_from_cones;
    Eigen::Matrix3d cones_from_drive;
    Eigen::Vector3d drive_of_white;  ///< M^-1 A^-1 W
  };
  [[nodiscard]] const Constants& constants() const { return constants_; }
  [[nodiscard]] const LuminanceCeiling& ceiling() const { return ceiling_; }
  /// Empty without a residual, or without compensation.
  [[nodiscard]] const calibration::DriveCorrection& correction() const { return correction_; }
  [[nodiscard]] const std::array<ToneLevels, 3>& tone_levels() const { return tone_levels_; }

 private:
  void map_to_gamut(const Xyz& target,
                    const Eigen::Vector3d& wanted_drive,
                    double g,
                    const Eigen::Vector3d& reflectance,
                    CompensatedPixel& pixel) const;
  using Brackets = std::array<ToneLevels::Bracket, 3>;
  [[nodiscard]] Brackets brackets(const Eigen::Vector3d& drive) const;
  void hold(const Eigen::Vector3d& thresholds, CompensatedPixel& pixel) const;
  Constants constants_;
  LuminanceCeiling ceiling_;
  calibration::DriveCorrection correction_;
  std::array<ToneLevels, 3> tone_levels_;
};

/// The profile's vignetting at every pixel of its raster.
[[nodiscard]] Image<float> vignetting_raster(const calibration::ProjectorProfile& profile);
/// The surface's relative reflectance at every pixel of the raster, or where the profile has no map
/// of it a single white pixel, which stands for all.
[[nodiscard]] Image<Rgb32f> reflectance_raster(const calibration::ProjectorProfile& profile);

}  // namespace veneer::render
