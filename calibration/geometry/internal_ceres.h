// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace veneer::geometry {

/// To the end of the arithmetic, on one thread and without a BLAS, whichever it would be: the
/// answer is to be the same whatever the start and the machine.
[[nodiscard]] inline ceres::Solver::Options tight_options() {
  // What a solver makes of a hopeless start is told by its summary, not on standard error.
  FLAGS_minloglevel = google::GLOG_FATAL;
  ceres::Solver::Options options;
  options.max_num_iterations = 1000;
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-16;
  options.parameter_tolerance = 1e-13;
  options.linear_solver_type = ceres::DENSE_QR;
  options.dense_linear_algebra_library_type = ceres::EIGEN;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  return options;
}

/// Standard deviations of the unknowns in `blocks` at the problem's minimum, if its residuals have
/// the deviation 1; absent where a direction is open. What is held constant has 0.
[[nodiscard]] inline std::optional<std::vector<std::vector<double>>> deviations_of(
    ceres::Problem& problem, const std::vector<const double*>& blocks) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.num_threads = 1;
  ceres::Covariance covariance(options);
  std::vector<std::pair<const double*, const double*>> pairs;
  for (const double* block : blocks) pairs.emplace_back(block, block);
  if (!covariance.Compute(pairs, &problem)) return std::nullopt;
  std::vector<std::vector<double>> deviations;
  for (const double* block : blocks) {
    const auto size = static_cast<std::size_t>(problem.ParameterBlockSize(block));
    std::vector<double> square(size * size, 0);
    std::vector<double> each(size, 0);
    if (!covariance.GetCovarianceBlock(block, block, square.data())) return std::nullopt;
    for (std::size_t i = 0; i < size; ++i) each[i] = std::sqrt(std::max(0.0, square[i * size + i]));
    deviations.push_back(std::move(each));
  }
  return deviations;
}

/// Sum of squares over degrees of freedom; absent where there are none.
[[nodiscard]] inline std::optional<double> variance_of(ceres::Problem& problem) {
  double cost = 0;
  problem.Evaluate({}, &cost, nullptr, nullptr, nullptr);
  int unknowns = 0;
  std::vector<double*> blocks;
  problem.GetParameterBlocks(&blocks);
  for (double* block : blocks) {
    if (!problem.IsParameterBlockConstant(block))
      unknowns += problem.ParameterBlockTangentSize(block);
  }
  const int freedom = problem.NumResiduals() - unknowns;
  if (freedom <= 0) return std::nullopt;
  return 2 * cost / freedom;
}

}  // namespace veneer::geometry
