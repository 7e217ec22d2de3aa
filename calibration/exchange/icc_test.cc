// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/icc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace veneer::calibration {
namespace {

/// Between the profile, as LittleCMS evaluates it, and the model that it was made from. Just
/// visible is about 1; what is asked for is half of that.
constexpr double kLargestDe00 = 0.5;

/// S-shaped as a DLP's, with a slope at 0.
std::vector<double> curve(double steepness, int size) {
  std::vector<double> values;
  for (int i = 0; i < size; ++i) {
    const double d = static_cast<double>(i) / (size - 1);
    values.push_back(0.02 * d +
                     0.98 * std::pow(d, steepness) / (std::pow(d, steepness) + 0.4 * (1 - d)));
  }
  return values;
}

IccSource projector() {
  IccSource source;
  source.tone_curves = {curve(2.0, 256), curve(2.2, 256), curve(2.4, 256)};
  source.primaries << 120, 80, 60,  //
      60, 210, 25,                  //
      4, 30, 330;
  return source;
}

double at(const std::vector<double>& values, double d) {
  const double scaled = d * static_cast<double>(values.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(scaled), values.size() - 2);
  return values[i] + (scaled - static_cast<double>(i)) * (values[i + 1] - values[i]);
}

Xyz matrix_model(const IccSource& source, const Eigen::Vector3d& drive) {
  return source.primaries * Eigen::Vector3d(at(source.tone_curves[0], drive.x()),
                                            at(source.tone_curves[1], drive.y()),
                                            at(source.tone_curves[2], drive.z()));
}

std::vector<Eigen::Vector3d> drives() {
  std::vector<Eigen::Vector3d> result;
  for (int i = 0; i <= 64; ++i) result.emplace_back(Eigen::Vector3d::Constant(i / 64.0));
  Pcg32 random(21);
  for (int i = 0; i < 1000; ++i) {
    const auto uniform = [&] { return random.uniform(); };
    result.emplace_back(uniform(), uniform(), uniform());
  }
  return result;
}

double largest_difference(const IccSource& source,
                          const std::function<Xyz(const Eigen::Vector3d&)>& model) {
  const auto bytes = icc_bytes(source);
  EXPECT_TRUE(bytes) << bytes.error().what;
  const auto labs = evaluate_icc(*bytes, drives());
  EXPECT_TRUE(labs) << labs.error().what;
  const Xyz white = model(Eigen::Vector3d::Ones());
  const Xyz d50(0.9642, 1, 0.8249);
  const Eigen::Matrix3d adapted = bradford_adaptation(white / white.y(), d50) / white.y();
  double largest = 0;
  for (std::size_t i = 0; i < labs->size(); ++i) {
    const Lab expected = lab_from_xyz(adapted * model(drives()[i]), d50);
    largest = std::max(largest, delta_e_2000((*labs)[i], expected));
  }
  return largest;
}

TEST(Icc, MatrixAndCurvesAreTheModelThroughLittleCms) {
  const IccSource source = projector();
  const double largest =
      largest_difference(source, [&](const Eigen::Vector3d& d) { return matrix_model(source, d); });
  RecordProperty("de00_max", std::to_string(largest));
  EXPECT_LT(largest, kLargestDe00);
}

TEST(Icc, AGridHoldsWhatNoMatrixDoes) {
  // A white segment of a quarter, and a black.
  const IccSource plain = projector();
  const auto model = [&](const Eigen::Vector3d& d) {
    const double least = std::min({at(plain.tone_curves[0], d.x()),
                                   at(plain.tone_curves[1], d.y()),
                                   at(plain.tone_curves[2], d.z())});
    return Xyz(matrix_model(plain, d) + 0.25 * least * Xyz(240, 250, 270) + Xyz(0.4, 0.4, 0.5));
  };
  IccSource source = plain;
  source.forward = model;
  const double with_grid = largest_difference(source, model);
  RecordProperty("de00_max", std::to_string(with_grid));
  EXPECT_LT(with_grid, kLargestDe00);
  EXPECT_GT(largest_difference(plain, model), 2 * kLargestDe00);
}

TEST(Icc, WhiteIsWhite) {
  const auto bytes = icc_bytes(projector());
  ASSERT_TRUE(bytes);
  const std::vector<Eigen::Vector3d> ends{Eigen::Vector3d::Ones(), Eigen::Vector3d::Zero()};
  const auto labs = evaluate_icc(*bytes, ends);
  ASSERT_TRUE(labs);
  constexpr double kFixedPoint = 0.01;  // of L*a*b*, from 16 bits behind the point
  EXPECT_NEAR((*labs)[0].l, 100, kFixedPoint);
  EXPECT_NEAR((*labs)[0].a, 0, kFixedPoint);
  EXPECT_NEAR((*labs)[0].b, 0, kFixedPoint);
  EXPECT_NEAR((*labs)[1].l, 0, kFixedPoint);
}

TEST(Icc, ItIsOfVersionTwoSoThatArgyllReadsIt) {
  const auto bytes = icc_bytes(projector());
  ASSERT_TRUE(bytes);
  ASSERT_GT(bytes->size(), 128U);
  EXPECT_EQ(static_cast<int>((*bytes)[8]), 2);
  EXPECT_EQ(bytes->substr(12, 12), "mntrRGB XYZ ");
}

TEST(Icc, LongCurvesAreThinnedOut) {
  IccSource source = projector();
  source.tone_curves = {curve(2.0, 65536), curve(2.2, 65536), curve(2.4, 1 << 12)};
  EXPECT_LT(
      largest_difference(source, [&](const Eigen::Vector3d& d) { return matrix_model(source, d); }),
      kLargestDe00);
}

TEST(Icc, WhatMakesNoProfileIsRefused) {
  const auto refused = [](auto change) {
    IccSource source = projector();
    change(source);
    return !icc_bytes(source).has_value();
  };
  EXPECT_FALSE(refused([](IccSource&) {}));
  EXPECT_TRUE(refused([](IccSource& s) { s.tone_curves[1].clear(); }));
  EXPECT_TRUE(refused([](IccSource& s) { s.tone_curves[1][3] = std::nan(""); }));
  EXPECT_TRUE(refused([](IccSource& s) { s.tone_curves[1][3] = 1.5; }));
  EXPECT_TRUE(refused([](IccSource& s) { s.primaries.setZero(); }));
  EXPECT_TRUE(refused([](IccSource& s) { s.primaries(0, 0) = INFINITY; }));
  EXPECT_TRUE(refused([](IccSource& s) { s.primaries = -s.primaries; }));
  EXPECT_TRUE(refused([](IccSource& s) { s.description = "M\xFCnchen"; }));
  EXPECT_TRUE(refused([](IccSource& s) {
    s.forward = [](const Eigen::Vector3d& d) { return Xyz(Xyz::Constant(d.x() / d.y())); };
  }));
  EXPECT_TRUE(refused([](IccSource& s) {
    s.forward = [](const Eigen::Vector3d& d) { return Xyz(d); };
    s.grid_nodes = 1;
  }));
}

TEST(Icc, WhatIsNoProfileIsRefused) {
  const auto bytes = icc_bytes(projector());
  ASSERT_TRUE(bytes);
  EXPECT_FALSE(evaluate_icc("", {}));
  EXPECT_FALSE(evaluate_icc("no profile at all", {}));
  EXPECT_FALSE(evaluate_icc(std::string_view(*bytes).substr(0, 200), {}));
}

TEST(Bradford, WhiteGoesToWhiteAndBack) {
  const Xyz d65(0.95047, 1, 1.08883);
  const Xyz d50(0.9642, 1, 0.8249);
  constexpr double kRoundingTolerance = 1e-12;
  EXPECT_LT((bradford_adaptation(d65, d50) * d65 - d50).norm(), kRoundingTolerance);
  EXPECT_TRUE((bradford_adaptation(d65, d50) * bradford_adaptation(d50, d65))
                  .isIdentity(kRoundingTolerance));
}

}  // namespace
}  // namespace veneer::calibration
