// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/statistics.h"
#include "calibration/maps/internal_fall_off_model.h"

namespace veneer::calibration::internal {
namespace {

/// Fewer poses than this are not left out one by one: what remains could not tell the camera's
/// fall-off from the projector's.
constexpr int kLeastPosesLeftOut = 4;
/// A model with more terms has to predict better by this part of the error.
constexpr double kWorthwhile = 1e-3;
/// Added to the diagonal, relative to its mean, so that what no sample fixes stays near 0.
constexpr double kRidge = 1e-9;

/// Moments of the columns `which` of data.
template <class Indices>
Moments moments_of(const Data& data, const Eigen::VectorXd& weight, const Indices& which) {
  Moments sums = Moments::Zero();
  Row mean = Row::Zero();
  double total = 0;
  // A block at a time: products of matrices are what runs fast.
  constexpr int kBlock = 256;
  Eigen::Matrix<double, kRow, Eigen::Dynamic> block(kRow, kBlock);
  int filled = 0;
  const auto add = [&] {
    sums.noalias() += block.leftCols(filled) * block.leftCols(filled).transpose();
    filled = 0;
  };
  for (const std::int64_t i : which) {
    if (!(weight[i] > 0)) continue;
    block.col(filled++) = std::sqrt(weight[i]) * data.rows.col(i);
    mean += weight[i] * data.rows.col(i);
    total += weight[i];
    if (filled == kBlock) add();
  }
  add();
  if (total > 0) sums -= mean * mean.transpose() / total;
  return sums;
}

/// The columns [begin, end).
std::vector<std::int64_t> range(std::int64_t begin, std::int64_t end) {
  std::vector<std::int64_t> all(static_cast<std::size_t>(end - begin));
  std::iota(all.begin(), all.end(), begin);
  return all;
}

/// What is left of the moments' values, weighted sum of squares.
double squares_left(const Moments& moments, Row coefficients) {
  coefficients[kValue] = -1;
  return std::max(0.0, coefficients.dot(moments * coefficients));
}

/// Least squares over all poses, weights as given.
void fit_once(const Data& data, const Model& model, Fit& fit) {
  fit.moments.setZero();
  for (std::size_t pose = 0; pose < data.pose.size(); ++pose)
    fit.moments += moments_of(data, fit.weight, range(data.first[pose], data.first[pose + 1]));
  fit.coefficients = solve(fit.moments, model);
  fit.residual = data.rows.row(kValue).transpose();
  fit.residual -= data.rows.topRows<kValue>().transpose() * fit.coefficients.head<kValue>();
  fit.log_gains.assign(data.pose.size(), 0.0);
  for (std::size_t pose = 0; pose < data.pose.size(); ++pose) {
    const auto begin = data.first[pose];
    const auto count = data.first[pose + 1] - begin;
    auto residual = fit.residual.segment(begin, count);
    const auto weight = fit.weight.segment(begin, count);
    const double total = weight.sum();
    // A pose whose samples are all outliers keeps its plain mean.
    fit.log_gains[pose] = total > 0 ? weight.dot(residual) / total : residual.mean();
    residual.array() -= fit.log_gains[pose];
  }
}

/// The samples in parts of which each can be predicted from the others.
struct Fold {
  Moments seen = Moments::Zero();       // of all of its samples, as they are fitted
  Moments predicted = Moments::Zero();  // of those that lie where others do; outliers left out
  double weight = 0;                    // of the latter
};

std::vector<Fold> make_folds(const Data& data, const Fit& fit) {
  // Parts of the raster, over which samples of different folds are compared.
  constexpr int kCells = 12;
  const auto cell_of = [&](std::int64_t i) {
    // The first two terms are the coordinates, from -1 to 1.
    const auto part = [](double u) {
      return std::clamp(static_cast<int>((0.5 * u + 0.5) * kCells), 0, kCells - 1);
    };
    return std::array{part(data.rows(0, i)), part(data.rows(1, i))};
  };
  const bool by_pose = static_cast<int>(data.pose.size()) >= kLeastPosesLeftOut;
  // Neighbouring cells are in different folds, and each fold in every row and column of them.
  constexpr int kBlockFolds = 5;

  // A fold and pose has a gain of its own.
  std::vector<std::vector<std::vector<std::int64_t>>> members;  // [fold][pose in it]
  if (by_pose) {
    for (std::size_t pose = 0; pose < data.pose.size(); ++pose)
      members.push_back({range(data.first[pose], data.first[pose + 1])});
  } else {
    members.assign(kBlockFolds, std::vector<std::vector<std::int64_t>>(data.pose.size()));
    for (std::size_t pose = 0; pose < data.pose.size(); ++pose)
      for (std::int64_t i = data.first[pose]; i < data.first[pose + 1]; ++i) {
        const auto [x, y] = cell_of(i);
        members[static_cast<std::size_t>((x + 2 * y) % kBlockFolds)][pose].push_back(i);
      }
  }

  // Where just one pose has samples, its prediction by the others would be an extrapolation.
  std::array<std::array<int, kCells>, kCells> folds_in{};
  const auto count_cells = [&](const auto& fold) {
    std::array<std::array<bool, kCells>, kCells> has{};
    for (const auto& group : fold)
      for (const std::int64_t i : group) {
        const auto [x, y] = cell_of(i);
        has.at(static_cast<std::size_t>(y)).at(static_cast<std::size_t>(x)) = true;
      }
    for (std::size_t y = 0; y < kCells; ++y)
      for (std::size_t x = 0; x < kCells; ++x) folds_in[y][x] += has[y][x] ? 1 : 0;
  };
  for (const auto& fold : members) count_cells(fold);

  std::vector<Fold> folds;
  for (const auto& fold : members) {
    Fold made;
    for (const auto& group : fold) {
      made.seen += moments_of(data, fit.weight, group);
      std::vector<std::int64_t> shared;
      for (const std::int64_t i : group) {
        const auto [x, y] = cell_of(i);
        const int others =
            folds_in.at(static_cast<std::size_t>(y)).at(static_cast<std::size_t>(x)) - 1;
        if ((!by_pose || others > 0) && fit.weight[i] > 0) shared.push_back(i);
      }
      made.predicted += moments_of(data, data.light_weight, shared);
      for (const std::int64_t i : shared) made.weight += data.light_weight[i];
    }
    folds.push_back(made);
  }
  return folds;
}

/// Root mean square with which a model predicts each fold from the others.
double held_out_rms(const std::vector<Fold>& folds, const Model& model) {
  double squares = 0;
  double weight = 0;
  for (const Fold& fold : folds) {
    Moments others = Moments::Zero();
    for (const Fold& other : folds)
      if (&other != &fold) others += other.seen;
    squares += squares_left(fold.predicted, solve(others, model));
    weight += fold.weight;
  }
  return weight > 0 ? std::sqrt(squares / weight) : 0.0;
}

}  // namespace

RasterTerms raster_terms(const ProjectorGeometry& geometry, const Eigen::Vector2d& pixel) {
  constexpr int kMost = kOrders.back();
  const auto legendre = [](double x) {
    std::array<double, kMost + 1> l{1.0, x};
    for (std::size_t n = 1; n < kMost; ++n) {
      const auto m = static_cast<double>(n);
      l[n + 1] = ((2 * m + 1) * x * l[n] - m * l[n - 1]) / (m + 1);
    }
    return l;
  };
  const auto at_x = legendre(2.0 * pixel.x() / geometry.width - 1.0);
  const auto at_y = legendre(2.0 * pixel.y() / geometry.height - 1.0);
  const auto at_centre = legendre(0.0);
  RasterTerms terms;
  int term = 0;
  for (std::size_t degree = 1; degree <= kMost; ++degree)
    for (std::size_t j = 0; j <= degree; ++j)
      terms[term++] = at_x[degree - j] * at_y[j] - at_centre[degree - j] * at_centre[j];
  return terms;
}

Row solve(const Moments& moments, const Model& model) {
  const int raster = terms_of(model.order);
  const int camera = model.camera_terms;
  Eigen::MatrixXd normal(model.size(), model.size());
  normal.topLeftCorner(raster, raster) = moments.topLeftCorner(raster, raster);
  normal.topRightCorner(raster, camera) = moments.block(0, kRasterTerms, raster, camera);
  normal.bottomLeftCorner(camera, raster) = moments.block(kRasterTerms, 0, camera, raster);
  normal.bottomRightCorner(camera, camera) =
      moments.block(kRasterTerms, kRasterTerms, camera, camera);
  // The second term is for samples that are all alike.
  normal.diagonal().array() += kRidge * normal.diagonal().mean() + 1e-300;
  Eigen::VectorXd right(model.size());
  right << moments.col(kValue).head(raster), moments.col(kValue).segment(kRasterTerms, camera);
  const Eigen::VectorXd solution = normal.ldlt().solve(right);
  Row coefficients = Row::Zero();
  coefficients.head(raster) = solution.head(raster);
  coefficients.segment(kRasterTerms, camera) = solution.tail(camera);
  return coefficients;
}

Fit fit_robustly(const Data& data, const Model& model) {
  constexpr int kHuberSteps = 6;  // which find the way whatever the start
  constexpr int kTukeySteps = 8;  // after which weights change by less than 1e-3
  constexpr double kHuber = 1.345;
  constexpr double kTukey = 4.685;
  constexpr double kMadToDeviation = 1.4826;  // of a normal distribution
  constexpr double kLeastScale = 1e-5;        // of a relative deviation: rounding, not noise
  Fit fit;
  fit.weight = data.light_weight;
  for (int step = 0; step <= kHuberSteps + kTukeySteps; ++step) {
    fit_once(data, model, fit);
    if (step == kHuberSteps + kTukeySteps) break;
    const Eigen::ArrayXd deviation = fit.residual.array().abs() * data.light_weight.array().sqrt();
    const double scale = std::max(
        kLeastScale, kMadToDeviation * quantile({deviation.begin(), deviation.end()}, 0.5));
    for (std::int64_t i = 0; i < data.size(); ++i) {
      const double z = deviation[i] / scale;
      double keep = 0;
      if (step < kHuberSteps)
        keep = z < kHuber ? 1.0 : kHuber / z;
      else if (z < kTukey)
        keep = std::pow(1.0 - std::pow(z / kTukey, 2), 2);
      fit.weight[i] = keep * data.light_weight[i];
    }
  }
  return fit;
}

Choice choose_model(const Data& data, const Fit& fit, const std::vector<Model>& models) {
  const std::vector<Fold> folds = make_folds(data, fit);
  std::vector<Choice> choices;
  double least = std::numeric_limits<double>::infinity();
  for (const Model& model : models) {
    choices.push_back({model, held_out_rms(folds, model)});
    least = std::min(least, choices.back().held_out_rms);
  }
  Choice best = choices.back();
  for (const Choice& choice : choices)
    if (choice.held_out_rms <= least * (1 + kWorthwhile) && choice.model.size() < best.model.size())
      best = choice;
  if (best.held_out_rms > least * (1 + kWorthwhile))
    best = *std::ranges::min_element(choices, {}, &Choice::held_out_rms);
  return best;
}

double inflation_of(const Moments& moments,
                    const Model& model,
                    const std::vector<RasterTerms>& texels) {
  if (model.camera_terms == 0) return 1.0;
  const int terms = terms_of(model.order);
  const int camera = model.camera_terms;
  Eigen::MatrixXd raster = moments.topLeftCorner(terms, terms);
  raster.diagonal().array() += kRidge * raster.diagonal().mean();
  const Eigen::MatrixXd mixed = moments.block(0, kRasterTerms, terms, camera);
  const Eigen::LDLT<Eigen::MatrixXd> factors(raster);
  const Eigen::MatrixXd absorbed = factors.solve(mixed);
  // What P cannot imitate of C.
  const Eigen::MatrixXd distinct =
      moments.block(kRasterTerms, kRasterTerms, camera, camera) - mixed.transpose() * absorbed;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> spectrum(distinct);
  const double largest = moments.block(kRasterTerms, kRasterTerms, camera, camera).trace();
  constexpr double kSingular = 1e-12;
  if (!(spectrum.eigenvalues().minCoeff() > kSingular * largest))
    return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd root = spectrum.operatorInverseSqrt();
  double alone = 0;
  double added = 0;
  for (const auto& texel : texels) {
    const Eigen::VectorXd at = texel.head(terms);
    alone += at.dot(factors.solve(at));
    added += (root * (absorbed.transpose() * at)).squaredNorm();
  }
  return alone > 0 ? std::sqrt(1.0 + added / alone) : 1.0;
}

}  // namespace veneer::calibration::internal
