// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "base/result.h"
#include "calibration/colour/colour_model.h"
#include "calibration/colour/tone_table.h"

namespace veneer::calibration {

/// The drive for a colour.
struct InverseColour {
  Eigen::Vector3d drive = Eigen::Vector3d::Zero();  ///< always in [0, 1]^3
  /// What the model sends at `drive` less what was asked for, largest of X, Y, Z in parts of the
  /// white's; for a colour out of gamut, less the colour it was moved to. Infinite for NaN.
  double residual = 0;
  bool in_gamut = true;
  double gamut_loss = 0;  ///< dE in IPT x 100 that gamut mapping made, as CompensatedPixel has it
  int iterations = 0;     ///< of Newton's method; 0 where the model was inverted directly
};

/// From light to drive, for any model.
///
/// Where the model can tell the drive itself (ColourModel::direct_inverse), that is taken. Else the
/// squared error is minimised inside the cube of drives by a damped Newton method (Levenberg 1944,
/// Marquardt 1963) over the linear drive t, whose curve the model's own ramps give; a step is only
/// taken if it makes the error less, so that it never diverges, and there are at most
/// kMostIterations. It starts from the matrix's solution, and, should that end in a place that is
/// not the colour, once more from a coarse grid's nearest point.
///
/// What cannot be reached is moved in IPT (Ebner and Fairchild 1998), relative to the white, on a
/// straight line of constant hue towards a neutral whose lightness is the colour's own, kept within
/// the middle half of those that can be shown: the rule of render/compensation.h.
class ColourInverse {
 public:
  /// @param model  borrowed; must outlive this.   @param black  XYZ of drive 0, cd/m^2.
  /// Errors: kBadFormat (two primaries of the same colour; a channel that does not rise).
  [[nodiscard]] static Result<ColourInverse> make(const ColourModel& model, const Xyz& black);

  /// @param target  XYZ above black, cd/m^2; anything.
  [[nodiscard]] InverseColour operator()(const Xyz& target) const;

  static constexpr int kMostIterations = 60;
  /// A residual below this counts as reached: a step of 16 bits is larger.
  static constexpr double kReached = 1e-5;

 private:
  ColourInverse(const ColourModel& model, const Xyz& black) : model_(&model), black_(black) {}
  struct Solution {
    Eigen::Vector3d drive;
    double residual = 0;
    int iterations = 0;
  };
  [[nodiscard]] Solution solve(const Xyz& target) const;
  [[nodiscard]] Solution descend(const Xyz& target, const Eigen::Vector3d& start) const;
  /// M^-1 F over the linear drive.
  [[nodiscard]] Eigen::Vector3d light_of(const Eigen::Vector3d& linear) const;
  void map_to_gamut(const Xyz& target, InverseColour& result) const;
  [[nodiscard]] double residual_of(const Xyz& target, const Eigen::Vector3d& drive) const;

  const ColourModel* model_;
  Xyz black_;
  Xyz white_ = Xyz::Ones();  ///< of full drive, above black
  ToneTable tones_;          ///< strictly rising
  struct GridPoint {
    Eigen::Vector3d linear;
    Eigen::Vector3d light;  ///< light_of(linear)
  };
  std::vector<GridPoint> grid_;
  double darkest_neutral_ = 0;  ///< in parts of white, IPT's lightness
};

}  // namespace veneer::calibration
