// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

// CGATS tables as ArgyllCMS, DisplayCAL and colord write them, read and written by LittleCMS.
//
// All readers refuse, with kBadFormat and a text that names the file and the row: another kind of
// table, missing columns, numbers that are none or not finite, sample ids that occur twice, tables
// that break off, more than kMostSamples rows, a file over kLargestCgats, bytes that no text has.
// Their RGB columns occur in 0 to 1 (colord) and 0 to 100 (Argyll), and nothing in a file says
// which: it is 0 to 100 where any value is above 1.

inline constexpr std::size_t kLargestCgats = std::size_t{4} << 20U;  ///< bytes; real ones have 1 MB
inline constexpr int kMostSamples = 20000;  ///< DisplayCAL's largest chart has a quarter of it

/// Readings of patches: a .ti3.
struct MeasuredPatches {
  std::string instrument;  ///< TARGET_INSTRUMENT; empty where it does not say
  std::vector<PatchReading> patches;
};

/// Values normalised to Y = 100 of white come back in cd/m^2, by LUMINANCE_XYZ_CDM2.
/// Errors also: kBadFormat for COLOR_REP other than RGB_XYZ, a device that is no display, and
/// normalised values without a luminance.
/// @param origin  what error texts call the text.
[[nodiscard]] Result<MeasuredPatches> parse_ti3(std::string_view text, std::string_view origin);
/// Errors: kNotFound, kIo, and as above.
[[nodiscard]] Result<MeasuredPatches> read_ti3(const std::filesystem::path& path);

/// RGB in 0 to 100 and XYZ in cd/m^2, not normalised, as `colprof` takes it.
/// Errors: kBadFormat (no patches or too many, values that are not finite, drives outside [0, 1],
/// no drive above 0.01 though not all are 0: nobody could tell the scale).
[[nodiscard]] Result<std::string> ti3_text(const MeasuredPatches& measured);
/// Errors: as above, and kIo.
[[nodiscard]] Status write_ti3(const std::filesystem::path& path, const MeasuredPatches& measured);

/// The drives of a chart, a .ti1, in its order, in [0, 1]^3. XYZ in it are the program's
/// expectation of some display and are not read.
[[nodiscard]] Result<std::vector<Eigen::Vector3d>> parse_ti1(std::string_view text,
                                                             std::string_view origin);
[[nodiscard]] Result<std::vector<Eigen::Vector3d>> read_ti1(const std::filesystem::path& path);

/// Takes what an instrument reads of one kind of display to what it should have read: a .ccmx.
struct ColorimeterCorrection {
  std::string instrument;  ///< empty where it does not say
  std::string display;
  Eigen::Matrix3d corrected_from_read = Eigen::Matrix3d::Identity();  ///< of XYZ
};

/// Errors also: kBadFormat for a matrix that cannot be inverted.
[[nodiscard]] Result<ColorimeterCorrection> parse_ccmx(std::string_view text,
                                                       std::string_view origin);
[[nodiscard]] Result<ColorimeterCorrection> read_ccmx(const std::filesystem::path& path);

}  // namespace veneer::calibration
