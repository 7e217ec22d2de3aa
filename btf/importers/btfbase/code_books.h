// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <span>
#include <vector>

#include "base/result.h"
#include "btf/direction.h"

namespace veneer::btf {

/// The tables of one material, and how they make up a colour. A function of n dimensions is a row
/// of functions of one dimension less, one at each knot of an angle, each with its own scale:
///
///     texel -> 4-D function (numbered from 1) -> view azimuth -> 3-D -> view theta -> 2-D
///     2-D = (luminance, colour);  luminance -> alpha -> 1-D over beta;  colour -> alpha -> beta ->
///     (Cb, Cr)
///
/// Alpha and beta are the light's angles in a frame that turns with the view's azimuth. Between
/// knots values are interpolated linearly, over beta by a cubic Hermite spline with Catmull-Rom
/// tangents in knot units (one-sided at both ends).
class CodeBooks {
 public:
  /// Reads every table and checks every index. Errors: kNotFound, kBadFormat.
  [[nodiscard]] static Result<CodeBooks> read(const std::filesystem::path& folder);

  [[nodiscard]] int width() const { return slices6_.columns; }
  [[nodiscard]] int height() const { return slices6_.rows; }
  [[nodiscard]] int function_count() const { return slices4_.rows; }
  /// Which 4-D function a texel shows, from 0, and by how much it is scaled.
  [[nodiscard]] int function_of(int x, int y) const { return slices6_(y, x) - 1; }
  [[nodiscard]] double scale_of(int x, int y) const { return scale6_(y, x); }

  /// Where a pair of directions falls between the knots.
  struct Knot {
    int low;        // the knot below; the next one may wrap
    double weight;  // of the next one
  };
  struct Place {
    Knot phi;
    Knot theta;
    Knot alpha;
    Knot beta;
  };
  [[nodiscard]] Place place_of(const Direction& view, const Direction& light) const;
  /// The gamma-encoded colour of a 4-D function, 0 to 255 where in gamut.
  [[nodiscard]] Eigen::Vector3d colour(int function, const Place& place) const;

 private:
  template <class Number>
  struct Table {
    int rows = 0;
    int columns = 0;
    std::vector<Number> values;  // row by row
    [[nodiscard]] Number operator()(int row, int column) const {
      return values[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                    static_cast<std::size_t>(column)];
    }
  };
  template <class Number>
  [[nodiscard]] static Result<Table<Number>> read_table(const std::filesystem::path& path);
  [[nodiscard]] Status check(const std::filesystem::path& folder) const;
  [[nodiscard]] double luminance(int function, const Place& place) const;
  [[nodiscard]] Eigen::Vector2d chroma(int function, const Place& place) const;
  [[nodiscard]] double spline(int function, const Knot& beta) const;

  Table<int> slices6_;
  Table<float> scale6_;
  Table<int> slices4_;  // [4-D][view phi]
  Table<float> scale4_;
  Table<int> slices3_;  // [3-D][view theta]
  Table<float> scale3_;
  Table<int> pairs2_;   // [2-D][luminance, colour]
  Table<int> slices2_;  // [luminance][alpha]
  Table<float> scale2_;
  Table<float> curves_;             // [1-D][beta]
  Table<int> colours2_;             // [colour][alpha]
  Table<int> indices_;              // [row of colours][beta]
  Table<float> chroma_;             // [colour][Cb, Cr]
  std::vector<double> beta_knots_;  // radians
};

}  // namespace veneer::btf
