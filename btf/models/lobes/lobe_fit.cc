// SPDX-License-Identifier: Apache-2.0
#include "btf/models/lobes/lobe_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/result.h"
#include "btf/models/material_tensors.h"

namespace veneer::btf {
namespace {

// Samples that starts are tried on.
constexpr Eigen::Index kPartSamples = 768;
// Steps for each start, those that go on by what they leave, and the steps these get. Reflectance
// fields of the wallpaper, 16 x 16 texels: all three to the end (12 steps) leave an encoded epsilon
// of .0234, these .0230 in a sixth of the time; with one kept, one lobe in 60 is missed by the
// test.
constexpr int kTrialIterations = 2;
constexpr std::size_t kKept = 2;
constexpr int kPartIterations = 6;
constexpr int kIterations = 25;
// A step that gains less than this part of the error is the last but one.
constexpr double kLeastGain = 1e-3;
// What a lobe may rise to anywhere, relative to its largest value at a sample.
constexpr float kMostRise = 4.0F;
// Amplitudes relative to the largest: less is invisible, and C = c amplitude^(1/n) must not vanish
// in float16.
constexpr float kLeastAmplitude = 1e-3F;
// A lobe that is added starts small beside those that fit already. At 0.3, a fourth lobe may end
// worse than three.
constexpr float kAddedAmplitude = 0.1F;
// Rows whose products are summed in float before they join the sums in double.
constexpr int kBlock = 256;
// Below any positive base that matters. With kLeastLogarithm, squares and slopes of what is stored
// here stay above where float underflows, where every product would take a hundred times as long.
constexpr float kTinyBase = 1e-6F;
constexpr float kLeastLogarithm = -30.0F;
// Two columns are parallel where the determinant of their Gram matrix is this part of its diagonal.
constexpr double kParallel = 1e-7;
constexpr double kLeastDamping = 1e-7;
constexpr double kMostDamping = 1e7;
constexpr int kColumns = 2;  // the diffuse column and that of all lobes
constexpr int kMostUnknowns = kLobeValues * FitOptions::kMostLobes;
constexpr int kMostColumns = kColumns + kMostUnknowns;

// Products of the columns (diffuse, lobes, derivatives by each lobe's c and log n), with each other
// and with the targets.
struct Products {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostColumns, kMostColumns> gram;
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMostColumns, 3> by_target;
  double target = 0.0;  // squared
};

using Unknowns = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostUnknowns, 1>;

// The colours that fit best, and what is left.
struct Colours {
  Eigen::Matrix<double, kColumns, 3> value = Eigen::Matrix<double, kColumns, 3>::Zero();
  double squared_error = 0.0;
};

// The largest base over all directions.
float reach(LobeSpace space, const Eigen::Vector3f& c) {
  const float up = std::max(c.z(), 0.0F);
  if (space == LobeSpace::kPair) return std::max(c.head<2>().cwiseAbs().maxCoeff(), up);
  return std::hypot(c.head<2>().norm(), up);
}

// Bounded exponents, largest base and largest amplitude 1. False where a lobe hardly reaches any
// sample, so that what it is elsewhere would be made up.
bool normalise(const LobeSamples& samples, std::span<LobeShape> shapes) {
  float largest = 0.0F;
  for (LobeShape& shape : shapes) {
    const float r = reach(samples.space, shape.c);
    if (!(r > 0.0F) || !shape.c.allFinite() || !std::isfinite(shape.exponent)) return false;
    shape.c /= r;
    const float peak = (samples.u.col(0) * shape.c.x() + samples.u.col(1) * shape.c.y() +
                        samples.u.col(2) * shape.c.z())
                           .maxCoeff();
    if (!(peak * kMostRise >= 1.0F)) return false;
    const float bound = peak < 1.0F ? std::log(kMostRise) / -std::log(peak) : kMostExponent;
    shape.exponent = std::clamp(
        shape.exponent, kLeastExponent, std::clamp(bound, kLeastExponent, kMostExponent));
    shape.amplitude *= std::pow(r, shape.exponent);
    largest = std::max(largest, shape.amplitude);
  }
  if (!std::isfinite(largest) || !(largest > 0.0F)) return false;
  for (LobeShape& shape : shapes)
    shape.amplitude = std::max(shape.amplitude / largest, kLeastAmplitude);
  return true;
}

// A block of samples: the columns of Products, the targets, and columns of any finite content so
// that products can be taken in tiles.
constexpr int kTileRows = 2;
constexpr int kTileColumns = 4;
constexpr int kLanes = 8;
using Lanes = Eigen::Array<float, kLanes, 1>;
using Block = Eigen::Matrix<float, kBlock, kMostColumns + 3 + kTileColumns - 1>;

// The products of columns i, i + 1 with j to j + 3, kept in registers on their way down the rows.
Eigen::Matrix<float, kTileRows, kTileColumns> tile(const Block& block, int i, int j, int rows) {
  const float* left = block.col(i).data();
  const float* right = block.col(j).data();
  std::array<Lanes, kTileRows * kTileColumns> sums;
  for (Lanes& sum : sums) sum.setZero();
  for (int row = 0; row < rows; row += kLanes)
    for (int r = 0; r < kTileRows; ++r) {
      const Eigen::Map<const Lanes, Eigen::Aligned32> a(left + r * kBlock + row);
      for (int c = 0; c < kTileColumns; ++c)
        sums[static_cast<std::size_t>(r * kTileColumns + c)] +=
            a * Eigen::Map<const Lanes, Eigen::Aligned32>(right + c * kBlock + row);
    }
  Eigen::Matrix<float, kTileRows, kTileColumns> products;
  for (int r = 0; r < kTileRows; ++r)
    for (int c = 0; c < kTileColumns; ++c)
      products(r, c) = sums[static_cast<std::size_t>(r * kTileColumns + c)].sum();
  return products;
}

// Columns `begin` to `begin + rows` of the samples; those of the lobes and their derivatives.
void fill(const LobeSamples& samples,
          const LobeTargets& targets,
          std::span<const LobeShape> shapes,
          bool slopes,
          Eigen::Index begin,
          int rows,
          int columns,
          Block& block) {
  Eigen::Array<float, kBlock, 1> base_rows;
  Eigen::Array<float, kBlock, 1> logarithm_rows;
  Eigen::Array<float, kBlock, 1> value_rows;
  auto base = base_rows.head(rows);
  auto logarithm = logarithm_rows.head(rows);
  auto value = value_rows.head(rows);
  const auto u = samples.u.middleRows(begin, rows);
  const auto column = [&](int i) { return block.col(i).head(rows).array(); };
  column(0) = samples.cosine.segment(begin, rows) * targets.weight.segment(begin, rows);
  column(1).setZero();
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const LobeShape& shape = shapes[i];
    base = (u.col(0) * shape.c.x() + u.col(1) * shape.c.y() + u.col(2) * shape.c.z()).max(0.0F);
    logarithm = shape.exponent * base.max(kTinyBase).log();
    value = logarithm.max(kLeastLogarithm).exp() * (shape.amplitude * column(0));
    column(1) += value;
    if (!slopes) continue;
    const int at = kColumns + kLobeValues * static_cast<int>(i);
    column(at + 3) = value * logarithm;
    // n value / base, and 0 where the base is not positive.
    value *= shape.exponent * base / (base.square() + kTinyBase * kTinyBase);
    for (int axis = 0; axis < 3; ++axis) column(at + axis) = value * u.col(axis);
  }
  block.block(0, columns, rows, 3) = targets.rgb.middleRows(begin, rows);
  block.block(0, columns + 3, rows, kTileColumns - 1).setZero();
}

// Without derivatives where `slopes` is false.
Products products_of(const LobeSamples& samples,
                     const LobeTargets& targets,
                     std::span<const LobeShape> shapes,
                     bool slopes) {
  const int columns = kColumns + (slopes ? kLobeValues * static_cast<int>(shapes.size()) : 0);
  Products sums;
  sums.gram.setZero(columns, columns);
  sums.by_target.setZero(columns, 3);
  Block block;
  for (Eigen::Index begin = 0; begin < samples.u.rows(); begin += kBlock) {
    const auto rows = static_cast<int>(std::min<Eigen::Index>(kBlock, samples.u.rows() - begin));
    fill(samples, targets, shapes, slopes, begin, rows, columns, block);
    const int padded = (rows + kLanes - 1) / kLanes * kLanes;
    block.block(rows, 0, padded - rows, columns + 3 + kTileColumns - 1).setZero();
    for (int i = 0; i < columns; i += kTileRows)
      for (int j = i; j < columns + 3; j += kTileColumns) {
        const Eigen::Matrix<float, kTileRows, kTileColumns> products = tile(block, i, j, padded);
        for (int c = 0; c < kTileColumns; ++c) {
          const auto both = products.col(c).cast<double>();
          if (j + c < columns)
            sums.gram.col(j + c).segment<kTileRows>(i) += both;
          else if (j + c < columns + 3)
            sums.by_target.col(j + c - columns).segment<kTileRows>(i) += both;
        }
      }
    sums.target += static_cast<double>(targets.rgb.middleRows(begin, rows).squaredNorm());
  }
  sums.gram.triangularView<Eigen::StrictlyLower>() = sums.gram.transpose();
  return sums;
}

// Least squares with both colours >= 0, for each channel on its own.
Colours solve(const Products& products, Diffuse diffuse) {
  const Eigen::Matrix2d gram = products.gram.topLeftCorner<kColumns, kColumns>();
  Colours colours{.squared_error = products.target};
  for (int channel = 0; channel < 3; ++channel) {
    const Eigen::Vector2d b = products.by_target.col(channel).head<kColumns>();
    const auto alone = [&](int column) {
      const double square = gram(column, column);
      return square > 0.0 ? std::max(b[column], 0.0) / square : 0.0;
    };
    Eigen::Vector2d x(0.0, alone(1));
    if (diffuse == Diffuse::kFree) {
      const double determinant = gram.determinant();
      Eigen::Vector2d both(gram(1, 1) * b[0] - gram(0, 1) * b[1],
                           gram(0, 0) * b[1] - gram(0, 1) * b[0]);
      if (determinant > kParallel * gram(0, 0) * gram(1, 1))
        both /= determinant;
      else
        both.setConstant(-1.0);
      if (both.minCoeff() >= 0.0)
        x = both;
      else if (alone(0) * b[0] >= x[1] * b[1])
        x = {alone(0), 0.0};
    }
    colours.value.col(channel) = x;
    colours.squared_error += x.dot(gram * x) - 2.0 * x.dot(b);
  }
  colours.squared_error = std::max(colours.squared_error, 0.0);
  return colours;
}

// Normal equations of the lobes' parameters, the colours projected out. A colour at its bound is no
// unknown there.
struct Step {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostUnknowns, kMostUnknowns> matrix;
  Unknowns gradient;
};
Step step_of(const Products& products, const Colours& colours) {
  const Eigen::Index unknowns = products.gram.rows() - kColumns;
  const Eigen::Matrix2d gram = products.gram.topLeftCorner<kColumns, kColumns>();
  const auto cross = products.gram.bottomLeftCorner(unknowns, kColumns);
  const auto slopes = products.gram.bottomRightCorner(unknowns, unknowns);
  // Squares of the specular colours, where the diffuse one is free and where it is not.
  double free = 0.0;
  double bound = 0.0;
  for (int channel = 0; channel < 3; ++channel) {
    const Eigen::Vector2d x = colours.value.col(channel);
    (x[0] > 0.0 ? free : bound) += x[1] * x[1];
  }
  Eigen::Matrix2d inverse = Eigen::Matrix2d::Zero();
  if (free > 0.0) inverse = free * gram.inverse();
  if (bound > 0.0) inverse(1, 1) += bound / gram(1, 1);
  const Eigen::Vector3d specular = colours.value.row(1);
  Step step;
  step.matrix = (free + bound) * slopes - cross * (inverse * cross.transpose());
  step.gradient =
      products.by_target.bottomRows(unknowns) * specular - cross * (colours.value * specular);
  return step;
}

void move(std::span<LobeShape> shapes, const Unknowns& by) {
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const Eigen::Vector4d d = by.segment<kLobeValues>(kLobeValues * static_cast<Eigen::Index>(i));
    shapes[i].c += d.head<3>().cast<float>();
    shapes[i].exponent *= static_cast<float>(std::exp(std::clamp(d[3], -1.0, 1.0)));
  }
}

// Levenberg-Marquardt; returns the squared error reached, infinite where the start reaches nothing.
double descend(const LobeSamples& samples,
               const LobeTargets& targets,
               Diffuse diffuse,
               int iterations,
               std::vector<LobeShape>& shapes) {
  if (!normalise(samples, shapes)) return std::numeric_limits<double>::infinity();
  Products products = products_of(samples, targets, shapes, true);
  Colours colours = solve(products, diffuse);
  std::vector<LobeShape> tried;
  double damping = 1e-2;
  for (int i = 0; i < iterations && damping < kMostDamping; ++i) {
    Step step = step_of(products, colours);
    const double scale = step.matrix.diagonal().maxCoeff();
    if (!(scale > 0.0)) break;
    // Marquardt's scaling, with a floor for what the samples do not say at all.
    step.matrix.diagonal() +=
        damping * (step.matrix.diagonal().cwiseMax(0.0).array() + 1e-6 * scale).matrix();
    tried = shapes;
    move(tried, step.matrix.ldlt().solve(step.gradient));
    const double before = colours.squared_error;
    if (normalise(samples, tried)) {
      Products at_tried = products_of(samples, targets, tried, true);
      const Colours then = solve(at_tried, diffuse);
      if (then.squared_error < before) {
        shapes.swap(tried);
        products = at_tried;
        colours = then;
        damping = std::max(damping * 0.2, kLeastDamping);
        if (before - then.squared_error < kLeastGain * before) break;
        continue;
      }
    }
    damping *= 5.0;
  }
  return colours.squared_error;
}

// Lobes on trial, and the squared error that they leave.
struct Trial {
  std::vector<LobeShape> shapes;
  double error = 0.0;
};

LobeSamples rows_of(const LobeSamples& all, const std::vector<Eigen::Index>& rows) {
  LobeSamples part{all.space,
                   Eigen::ArrayX3f(static_cast<Eigen::Index>(rows.size()), 3),
                   Eigen::ArrayXf(static_cast<Eigen::Index>(rows.size()))};
  for (Eigen::Index i = 0; i < part.u.rows(); ++i) {
    part.u.row(i) = all.u.row(rows[static_cast<std::size_t>(i)]);
    part.cosine[i] = all.cosine[rows[static_cast<std::size_t>(i)]];
  }
  return part;
}

}  // namespace

double lobe_value(std::span<const Eigen::half> stored, const Eigen::Vector3d& u) {
  const Eigen::Vector3d c(static_cast<double>(stored[0]),
                          static_cast<double>(stored[1]),
                          static_cast<double>(stored[2]));
  const double base = c.dot(u);
  return base > 0.0 ? std::pow(base, static_cast<double>(stored[3])) : 0.0;
}

LobeFitter::LobeFitter(LobeSamples samples, int lobes) : all_(std::move(samples)), lobes_(lobes) {
  VENEER_CHECK(all_.u.rows() > 0 && all_.u.rows() == all_.cosine.size() && lobes > 0 &&
               lobes <= FitOptions::kMostLobes);
  // An irrational stride, so that views and lights are taken evenly whatever their numbers.
  const Eigen::Index rows = all_.u.rows();
  const double golden = (std::sqrt(5.0) - 1.0) / 2.0;
  for (Eigen::Index i = 0; i < std::min(rows, kPartSamples); ++i) {
    const double place = static_cast<double>(i) * golden;
    part_rows_.push_back(
        rows <= kPartSamples
            ? i
            : static_cast<Eigen::Index>((place - std::floor(place)) * static_cast<double>(rows)));
  }
  std::ranges::sort(part_rows_);
  part_rows_.erase(std::unique(part_rows_.begin(), part_rows_.end()), part_rows_.end());
  part_ = rows_of(all_, part_rows_);
}

std::vector<LobeShape> LobeFitter::fit(const LobeTargets& targets,
                                       std::span<const LobeShape> starts) const {
  const auto rows = static_cast<Eigen::Index>(part_rows_.size());
  LobeTargets part{Eigen::ArrayXf(rows), Eigen::MatrixX3f(rows, 3)};
  for (Eigen::Index i = 0; i < rows; ++i) {
    part.weight[i] = targets.weight[part_rows_[static_cast<std::size_t>(i)]];
    part.rgb.row(i) = targets.rgb.row(part_rows_[static_cast<std::size_t>(i)]);
  }
  std::vector<LobeShape> shapes;
  for (int lobe = 0; lobe < lobes_; ++lobe) {
    std::vector<Trial> trials;
    for (const LobeShape& start : starts) {
      Trial& trial = trials.emplace_back(Trial{.shapes = shapes});
      trial.shapes.push_back(start);
      if (lobe > 0) trial.shapes.back().amplitude = kAddedAmplitude;
      trial.error = descend(part_, part, Diffuse::kFree, kTrialIterations, trial.shapes);
    }
    std::ranges::stable_sort(trials, {}, &Trial::error);
    trials.resize(std::min(trials.size(), kKept));
    for (Trial& trial : trials)
      trial.error = descend(part_, part, Diffuse::kFree, kPartIterations, trial.shapes);
    const auto best = std::ranges::min_element(trials, {}, &Trial::error);
    if (best == trials.end() || !std::isfinite(best->error)) break;  // none reaches the samples
    shapes = std::move(best->shapes);
  }
  refine(targets, Diffuse::kFree, shapes);
  return shapes;
}

void LobeFitter::refine(const LobeTargets& targets,
                        Diffuse diffuse,
                        std::vector<LobeShape>& shapes) const {
  descend(all_, targets, diffuse, kIterations, shapes);
}

std::vector<LobeShape> LobeFitter::shapes_of(const StoredLobes& stored) {
  std::vector<LobeShape> shapes;
  for (std::size_t i = 0; i + kLobeValues <= stored.lobes.size(); i += kLobeValues)
    shapes.push_back({{static_cast<float>(stored.lobes[i]),
                       static_cast<float>(stored.lobes[i + 1]),
                       static_cast<float>(stored.lobes[i + 2])},
                      static_cast<float>(stored.lobes[i + 3])});
  return shapes;
}

Eigen::ArrayXf LobeFitter::lobes_at_samples(const StoredLobes& stored) const {
  Eigen::ArrayXf sum = Eigen::ArrayXf::Zero(all_.u.rows());
  for (const LobeShape& shape : shapes_of(stored))
    sum += (shape.exponent * (all_.u.matrix() * shape.c).array().max(kTinyBase).log()).exp();
  return all_.cosine * sum;
}

StoredLobes LobeFitter::store(const LobeTargets& targets,
                              Diffuse diffuse,
                              std::span<const LobeShape> shapes) const {
  StoredLobes stored;
  std::vector<LobeShape> rounded;
  for (const LobeShape& shape : shapes) {
    const Eigen::half exponent = saturated_half(shape.exponent);
    const float scale = std::pow(shape.amplitude, 1.0F / static_cast<float>(exponent));
    LobeShape& as_stored = rounded.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      stored.lobes.push_back(saturated_half(scale * shape.c[axis]));
      as_stored.c[axis] = static_cast<float>(stored.lobes.back());
    }
    stored.lobes.push_back(exponent);
    as_stored.exponent = static_cast<float>(exponent);
  }
  for (int i = static_cast<int>(shapes.size()); i < lobes_; ++i)
    for (const float value : {0.0F, 0.0F, 0.0F, kLeastExponent})
      stored.lobes.push_back(Eigen::half(value));
  const Products products = products_of(all_, targets, rounded, false);
  const Colours colours = solve(products, diffuse);
  stored.squared_error = products.target;
  for (int channel = 0; channel < 3; ++channel) {
    stored.diffuse[static_cast<std::size_t>(channel)] =
        saturated_half(static_cast<float>(colours.value(0, channel)));
    stored.specular[static_cast<std::size_t>(channel)] =
        saturated_half(static_cast<float>(colours.value(1, channel)));
    const Eigen::Vector2d x(
        static_cast<double>(stored.diffuse[static_cast<std::size_t>(channel)]),
        static_cast<double>(stored.specular[static_cast<std::size_t>(channel)]));
    stored.squared_error += x.dot(products.gram * x) - 2.0 * x.dot(products.by_target.col(channel));
  }
  return stored;
}

}  // namespace veneer::btf
