// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/pca_spline/pca_spline.h"

#include <Eigen/SVD>

#include <array>
#include <utility>
#include <vector>

#include "base/result.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

ChannelLight light_of(const ChannelRamp& ramp, int components) {
  Eigen::MatrixX3d levels(static_cast<Eigen::Index>(ramp.light.size()), 3);
  for (std::size_t i = 0; i < ramp.light.size(); ++i)
    levels.row(static_cast<Eigen::Index>(i)) = ramp.light[i].transpose();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(levels, Eigen::ComputeThinU | Eigen::ComputeThinV);
  Eigen::Matrix3Xd colours = svd.matrixV().leftCols(components);
  // The first has one sign throughout, as light has; let it be light.
  if (colours.col(0).sum() < 0.0) colours.col(0) *= -1.0;
  std::vector<DriveCurve> curves;
  for (Eigen::Index k = 0; k < components; ++k) {
    const Eigen::VectorXd scores = levels * colours.col(k);
    curves.emplace_back(CubicHermite(ramp.drives,
                                     std::vector<double>(scores.begin(), scores.end()),
                                     components == 1 ? Slopes::kMonotone : Slopes::kSmooth));
  }
  return {std::move(colours), std::move(curves)};
}

Result<std::unique_ptr<ColourModel>> fit(std::span<const PatchReading> patches,
                                         const Xyz& black,
                                         int components) {
  VENEER_ASSIGN(AdditiveModel model, pca_spline(patches, black, components));
  return std::make_unique<AdditiveModel>(std::move(model));
}

}  // namespace

Result<AdditiveModel> pca_spline(std::span<const PatchReading> patches,
                                 const Xyz& black,
                                 int components) {
  VENEER_CHECK(components >= 1 && components <= 3);
  VENEER_ASSIGN(const ChannelRamps ramps, read_ramps(patches, black));
  int parameters = 0;
  for (const ChannelRamp& ramp : ramps) {
    // Scores of each level, and of each colour its direction.
    parameters += components * (static_cast<int>(ramp.drives.size()) - 1 + 2);
  }
  constexpr std::array<std::string_view, 3> kNames{"pca1-spline", "pca2-spline", "pca3-spline"};
  return AdditiveModel(kNames[static_cast<std::size_t>(components - 1)],
                       {light_of(ramps[0], components),
                        light_of(ramps[1], components),
                        light_of(ramps[2], components)},
                       parameters);
}

Result<std::unique_ptr<ColourModel>> fit_pca1_spline(std::span<const PatchReading> patches,
                                                     const Xyz& black) {
  return fit(patches, black, 1);
}

Result<std::unique_ptr<ColourModel>> fit_pca2_spline(std::span<const PatchReading> patches,
                                                     const Xyz& black) {
  return fit(patches, black, 2);
}

}  // namespace veneer::calibration
