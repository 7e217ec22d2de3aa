// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/interaction/interaction.h"

#include <Eigen/QR>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "calibration/colour/cube_model.h"
#include "calibration/colour/pca_spline/pca_spline.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

constexpr int kTerms = 10;
using Terms = Eigen::Matrix<double, kTerms, 1>;
using TermSlopes = Eigen::Matrix<double, kTerms, 3>;

/// Where a channel's load has come half way to what it is at full drive: dark enough for a load
/// that sets in early, and so bright that no term is steeper in the dark than the channel itself.
constexpr double kHalfLoad = 0.1;

double load_of(double t) { return (1.0 + kHalfLoad) * t / (t + kHalfLoad); }
double load_slope_of(double t) {
  return (1.0 + kHalfLoad) * kHalfLoad / ((t + kHalfLoad) * (t + kHalfLoad));
}

constexpr std::array<std::array<int, 2>, 3> kProducts{{{0, 1}, {1, 2}, {2, 0}}};
constexpr std::array<std::array<int, 2>, 6> kLoads{
    {{0, 1}, {1, 0}, {1, 2}, {2, 1}, {2, 0}, {0, 2}}};

Terms terms_of(const Eigen::Vector3d& t) {
  const Eigen::Vector3d load = t.unaryExpr(&load_of);
  Terms terms;
  int row = 0;
  for (const auto& [i, j] : kProducts) terms[row++] = t[i] * t[j];
  for (const auto& [i, j] : kLoads) terms[row++] = t[i] * load[j];
  terms[row] = t.prod();
  return terms;
}

// d terms / d t.
TermSlopes term_slopes_of(const Eigen::Vector3d& t) {
  TermSlopes slopes = TermSlopes::Zero();
  int row = 0;
  for (const auto& [i, j] : kProducts) {
    slopes(row, i) = t[j];
    slopes(row++, j) = t[i];
  }
  for (const auto& [i, j] : kLoads) {
    slopes(row, i) = load_of(t[j]);
    slopes(row++, j) = t[i] * load_slope_of(t[j]);
  }
  slopes.row(row) << t[1] * t[2], t[0] * t[2], t[0] * t[1];
  return slopes;
}

class InteractionModel final : public CubeModel {
 public:
  using Coefficients = Eigen::Matrix<double, 3, kTerms>;
  InteractionModel(AdditiveModel core, Coefficients coefficients)
      : core_(std::move(core)), coefficients_(std::move(coefficients)) {}
  [[nodiscard]] std::string_view name() const override { return "interaction"; }
  [[nodiscard]] int parameters() const override { return core_.parameters() + 3 * kTerms; }

 private:
  [[nodiscard]] Xyz inside(const Eigen::Vector3d& drive) const override {
    return core_.forward(drive) + coefficients_ * terms_of(core_.linear_drive(drive));
  }
  [[nodiscard]] Eigen::Matrix3d slope_inside(const Eigen::Vector3d& drive) const override {
    return core_.jacobian(drive) + coefficients_ * term_slopes_of(core_.linear_drive(drive)) *
                                       core_.linear_drive_slope(drive).asDiagonal();
  }
  AdditiveModel core_;
  Coefficients coefficients_;
};

}  // namespace

Result<std::unique_ptr<ColourModel>> fit_interaction(std::span<const PatchReading> patches,
                                                     const Xyz& black) {
  VENEER_ASSIGN(AdditiveModel core, pca_spline(patches, black, 2));
  const std::vector<PatchReading> mixtures = read_mixtures(patches, black);
  if (static_cast<int>(mixtures.size()) < kFewestMixtures)
    return fail(Errc::kBadFormat,
                "fitting interaction: {} patches drive several channels; {} or more are needed: "
                "measure mixtures too",
                mixtures.size(),
                kFewestMixtures);
  const double white = core.primaries().rowwise().sum().norm();
  const auto count = static_cast<Eigen::Index>(mixtures.size());
  Eigen::MatrixXd terms(count, kTerms);
  Eigen::MatrixX3d missing(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const PatchReading& mixture = mixtures[static_cast<std::size_t>(i)];
    const double weight = perceptual_weight(std::max(mixture.xyz.norm(), 0.0) / white);
    terms.row(i) = weight * terms_of(core.linear_drive(mixture.drive)).transpose();
    missing.row(i) = weight * (mixture.xyz - core.forward(mixture.drive)).transpose();
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(terms);
  // Terms whose ratio is less are told apart by noise alone.
  constexpr double kLeastPivot = 1e-4;
  solver.setThreshold(kLeastPivot);
  if (solver.rank() < kTerms)
    return fail(Errc::kBadFormat,
                "fitting interaction: the mixtures tell only {} of {} terms apart; measure "
                "mixtures at more levels",
                static_cast<int>(solver.rank()),
                kTerms);
  const Eigen::Matrix<double, kTerms, 3> solution = solver.solve(missing);
  return std::make_unique<InteractionModel>(std::move(core), solution.transpose());
}

}  // namespace veneer::calibration
