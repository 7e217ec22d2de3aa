// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace veneer::calibration {

/// A table over RGB as .cube files hold it: three curves, or a grid over the cube.
struct CubeTable {
  enum class Kind {
    k1d,  ///< values[i](c) is the output of channel c for input node i
    k3d,  ///< node (r, g, b) is at (b * size + g) * size + r: red fastest
  };
  Kind kind = Kind::k3d;
  int size = 0;  ///< nodes along an axis: 2 to 65536, of a grid 2 to 129
  std::string title;
  Eigen::Vector3d domain_min = Eigen::Vector3d::Zero();  ///< input at the first node, per channel
  Eigen::Vector3d domain_max = Eigen::Vector3d::Ones();
  std::vector<Eigen::Vector3d> values;

  /// Sizes, finiteness, domain_min < domain_max, a title without quotes and line ends.
  /// Errors: kBadFormat.
  [[nodiscard]] Status check() const;
  /// Linear between nodes (a grid: trilinear), clamped beyond the domain; NaN for NaN. The table
  /// must pass check().
  [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& rgb) const;

  /// A grid over [0, 1]^3. @param size  2 to 129 (checked).
  [[nodiscard]] static CubeTable sampled(
      int size, const std::function<Eigen::Vector3d(const Eigen::Vector3d& rgb)>& function);
};

/// Source of the layout: Adobe 2013, "Cube LUT Specification 1.0". Of its grid sizes up to 256 we
/// take 129, which is the largest that any program offers.
/// @param origin  what error texts call the text.
/// Errors: kBadFormat (names the line).
[[nodiscard]] Result<CubeTable> parse_cube(std::string_view text, std::string_view origin);
/// Errors: kNotFound, kIo, and as above.
[[nodiscard]] Result<CubeTable> read_cube(const std::filesystem::path& path);
/// With nine significant digits. Errors: kBadFormat.
[[nodiscard]] Result<std::string> cube_text(const CubeTable& table);
/// Errors: kBadFormat, kIo.
[[nodiscard]] Status write_cube(const std::filesystem::path& path, const CubeTable& table);

}  // namespace veneer::calibration
