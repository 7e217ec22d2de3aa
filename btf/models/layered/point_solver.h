// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "btf/models/layered/layer_stack.h"

namespace veneer::btf {

/// One value for each light and channel.
using LightRows = Eigen::Array<float, Eigen::Dynamic, 3>;

/// What a point of a layer sees from one view, and what it should send there.
struct PointView {
  Eigen::ArrayX3f u;      ///< view times light, element by element: [light][3]
  Eigen::ArrayXf weight;  ///< of the pairs' squared errors; empty: all alike
  LightRows wanted;       ///< measured, less what the layers above add
  LightRows below;        ///< what the layers below send
  float visible = 1.0F;   ///< product of the transmittances above
};

/// max(0, C . u)^k of a point for each light. @param u  [light][3]
void lobe_rows(const LayerPoint& point, const Eigen::ArrayX3f& u, Eigen::ArrayXf& out);

/// Finds colours, lobe, normal and, where it lies in shadow, the diffuse radiance of a point by an
/// incremental Gauss-Newton method: an extended Kalman filter (Bertsekas 1996; Magda and Kriegman
/// 2005, eq. 11 and 12). What is minimised is the residual before any division by a transmittance,
/// so that nothing is divided. The exponent is solved for as a logarithm and kept in its bounds;
/// the normal's length and the lobe's largest coefficient are kept at 1, since colours may stand
/// for both.
class PointSolver {
 public:
  static constexpr int kUnknowns = 14;  // K_d, K_s, C, log k, N, L_d

  /// @param with_radiance  whether L_d is free; without shadow it cannot be told from the colours.
  /// @param most_colour  that diffuse and specular colour may have together
  PointSolver(const LayerPoint& start, bool with_radiance, float most_colour);
  /// Takes in what one view says.
  /// @param shade  S of each light  @param lights  [light][3]
  void add(const PointView& view, const Eigen::ArrayXf& shade, const Eigen::ArrayX3f& lights);
  /// Moves to what has been taken in since the last step, and forgets by `forgetting` (0 to 1; 1
  /// keeps all). False where no step could be found, which leaves the point as it was.
  bool step(double forgetting);
  [[nodiscard]] const LayerPoint& point() const { return point_; }

 private:
  using Vector = Eigen::Matrix<double, kUnknowns, 1>;
  using Matrix = Eigen::Matrix<double, kUnknowns, kUnknowns>;
  LayerPoint point_;
  bool with_radiance_;
  float most_colour_;
  Matrix information_ = Matrix::Zero();
  Vector gradient_ = Vector::Zero();
  Eigen::Matrix<float, Eigen::Dynamic, kUnknowns> jacobian_;
  Eigen::ArrayXf lobe_;
};

/// A wide start for lobes and normal whose colour suits what is wanted.
/// @param order  which of the views
[[nodiscard]] LayerPoint start_of(std::span<const PointView> views,
                                  std::span<const int> order,
                                  const Eigen::ArrayXf& arrived,
                                  const Eigen::ArrayX3f& lights);

}  // namespace veneer::btf
