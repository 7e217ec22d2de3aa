// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/colour.h"
#include "base/result.h"

namespace veneer::calibration {

/// What an ICC profile of a projector is made from.
struct IccSource {
  std::string description = "Veneer projector";  ///< ASCII
  /// Per channel, relative output over equal steps of the drive from 0 to 1; 2 to 65536 values in
  /// [0, 1]. More than 4096 are thinned out, which is what the format's readers put up with.
  std::array<std::vector<double>, 3> tone_curves;
  Eigen::Matrix3d primaries = Eigen::Matrix3d::Identity();  ///< columns XYZ of R, G, B, cd/m^2
  /// What a drive in [0, 1]^3 sends, XYZ in cd/m^2, black and ambient light in it if wished. Where
  /// it is given, the profile holds a grid of it (the tag A2B0) beside matrix and curves; without
  /// it, M t(d), in which black is 0.
  std::function<Xyz(const Eigen::Vector3d& drive)> forward;
  int grid_nodes = 33;  ///< along each axis of that grid; 2 to 65
};

/// A display profile of ICC version 2.4, made by LittleCMS; what reads version 4 reads it too, and
/// ArgyllCMS reads no other. Colour is relative to the white of full drive and adapted from it to
/// D50 by the linear Bradford transform (tags wtpt and chad); the luminance of white, cd/m^2, is in
/// the tag lumi. The way back, from colour to drive, is by matrix and curves alone: the profile has
/// no B2A table. Veneer itself never reads one.
/// Errors: kBadFormat (says what of the source is wrong; or LittleCMS's own words).
[[nodiscard]] Result<std::string> icc_bytes(const IccSource& source);
/// Errors: as above, and kIo.
[[nodiscard]] Status write_icc(const std::filesystem::path& path, const IccSource& source);

/// What a colour management system makes of drives: L*a*b*, D50, relative to the profile's white.
/// Errors: kBadFormat (no profile of an RGB display).
[[nodiscard]] Result<std::vector<Lab>> evaluate_icc(std::string_view profile,
                                                    std::span<const Eigen::Vector3d> drives);

/// Takes XYZ under one white into what looks the same under another.
/// Source: ICC.1:2010, annex E: Lam's Bradford matrix without the power on blue.
/// @param from, to  whites, all of X, Y and Z > 0 (checked).
[[nodiscard]] Eigen::Matrix3d bradford_adaptation(const Xyz& from, const Xyz& to);

}  // namespace veneer::calibration
