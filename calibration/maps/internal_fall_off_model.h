// SPDX-License-Identifier: Apache-2.0
#pragma once

// The linear model behind measure_fall_off(): its terms, its robust fit, the choice among models.

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <vector>

#include "calibration/profile.h"

namespace veneer::calibration::internal {

inline constexpr std::array kOrders{2, 4, 6, 8};
inline constexpr int terms_of(int order) { return (order + 1) * (order + 2) / 2 - 1; }
inline constexpr int kRasterTerms = terms_of(kOrders.back());
inline constexpr int kCameraTerms = 3;
inline constexpr int kValue = kRasterTerms + kCameraTerms;  // index of log counts in a row
inline constexpr int kRow = kValue + 1;

/// P's and C's terms at a sample and its value, see kValue.
using Row = Eigen::Matrix<double, kRow, 1>;
using RasterTerms = Eigen::Matrix<double, kRasterTerms, 1>;

/// Products of Legendre polynomials over the raster by total degree, each zero at the centre; the
/// first two are the coordinates, from -1 to 1.
[[nodiscard]] RasterTerms raster_terms(const ProjectorGeometry& geometry,
                                       const Eigen::Vector2d& pixel);

/// Which columns of a Row a model uses.
struct Model {
  int order = 0;
  int camera_terms = 0;

  [[nodiscard]] int size() const { return terms_of(order) + camera_terms; }
};

/// Weighted sums of products of a group's rows about their weighted mean: its gain is out of them.
using Moments = Eigen::Matrix<double, kRow, kRow>;

/// The samples that are fitted, ordered by pose, and what weighs them.
struct Data {
  Eigen::Matrix<double, kRow, Eigen::Dynamic> rows;
  Eigen::VectorXd light_weight;
  std::vector<std::int64_t> first;  // of pose i: columns [first[i], first[i + 1])
  std::vector<int> pose;            // number of pose i

  [[nodiscard]] std::int64_t size() const { return rows.cols(); }
};

struct Fit {
  Row coefficients = Row::Zero();
  std::vector<double> log_gains;  // of the poses
  Eigen::VectorXd residual;
  Eigen::VectorXd weight;  // by light and by deviation
  Moments moments = Moments::Zero();
};

/// Robust least squares over all poses.
[[nodiscard]] Fit fit_robustly(const Data& data, const Model& model);

/// Coefficients of a model by moments of samples, all columns; 0 where it does not use one.
[[nodiscard]] Row solve(const Moments& moments, const Model& model);

struct Choice {
  Model model;
  double held_out_rms = 0;
};

/// The model that predicts best what was left out of a fit, and of those about as good the one of
/// fewest terms.
/// @param fit  of the largest model: says what is an outlier.
[[nodiscard]] Choice choose_model(const Data& data,
                                  const Fit& fit,
                                  const std::vector<Model>& models);

/// How many times larger errors of P become because C is fitted too, root mean square over the
/// texels whose terms are given; infinite where P can imitate C.
[[nodiscard]] double inflation_of(const Moments& moments,
                                  const Model& model,
                                  const std::vector<RasterTerms>& texels);

}  // namespace veneer::calibration::internal
