// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/baking.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/statistics.h"
#include "calibration/colour/internal_testing.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

constexpr double kNoise = 0.003;

std::unique_ptr<ColourModel> fit(const ColourModelFamily& family, const LadderDefects& defects) {
  const ExampleReadings readings = example_readings(defects, kNoise);
  auto model = family.fit(readings.patches, readings.black);
  EXPECT_TRUE(model.has_value()) << family.name << ": " << model.error().what;
  return model ? std::move(*model) : nullptr;
}

Vector3d linear_of(const BakedColour& baked, const std::array<std::size_t, 3>& code) {
  return {
      baked.tone_curves[0][code[0]], baked.tone_curves[1][code[1]], baked.tone_curves[2][code[2]]};
}

TEST(Baking, HasTheCurvesOfAProfile) {
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = fit(family, kEveryDefect);
    ASSERT_NE(model, nullptr);
    const auto baked = bake(*model, 10);
    ASSERT_TRUE(baked.has_value()) << baked.error().what;
    for (Eigen::Index c = 0; c < 3; ++c) {
      const std::vector<double>& curve = baked->tone_curves[static_cast<std::size_t>(c)];
      ASSERT_EQ(curve.size(), 1024U);
      EXPECT_EQ(curve.front(), 0.0);
      EXPECT_EQ(curve.back(), 1.0);
      EXPECT_TRUE(std::ranges::is_sorted(curve)) << family.name;
      EXPECT_EQ(Xyz(baked->primaries.col(c)), model->forward(Vector3d::Unit(c)));
    }
  }
}

TEST(Baking, LeavesNoResidualWhereChannelsAddUpAndKeepTheirColour) {
  for (const ColourModelFamily& family : colour_model_families()) {
    const bool fixed = family.name == "gog" || family.name == "plcc" ||
                       family.name == "plcc-spline" || family.name == "pca1-spline";
    const auto model = fit(family, {0.06, 0, 0});
    ASSERT_NE(model, nullptr);
    const auto baked = bake(*model, 8);
    ASSERT_TRUE(baked.has_value());
    EXPECT_EQ(baked->residual.empty(), fixed) << family.name;
    if (!fixed) continue;
    const double white = model->forward(Vector3d::Ones()).norm();
    for (std::size_t code = 0; code < 256; code += 5) {
      const Vector3d drive = drive_of_code({static_cast<std::uint16_t>(code), 100, 255}, 8);
      EXPECT_LT(
          (baked->forward(linear_of(*baked, {code, 100, 255})) - model->forward(drive)).norm(),
          1e-9 * white)
          << family.name << " " << code;
    }
  }
}

TEST(Baking, IsTheModelToATwentiethOfADifference) {
  for (const LadderDefects& defects : {LadderDefects{0.06, 0, 0},
                                       LadderDefects{0, 0.25, 0},
                                       LadderDefects{0, 0, 0.05},
                                       kEveryDefect}) {
    const Xyz black = LadderProjector(defects).black();
    for (const ColourModelFamily& family : colour_model_families()) {
      const auto model = fit(family, defects);
      ASSERT_NE(model, nullptr);
      const auto baked = bake(*model, 8);
      ASSERT_TRUE(baked.has_value());
      const Xyz white = model->forward(Vector3d::Ones()) + black;
      Pcg32 random(1);
      std::vector<double> differences;
      for (int i = 0; i < 4000; ++i) {
        const std::array<std::size_t, 3> code{
            random.next() % 256, random.next() % 256, random.next() % 256};
        const Vector3d drive = Vector3d(code[0], code[1], code[2]) / 255.0;
        differences.push_back(
            delta_e_2000(lab_from_xyz(baked->forward(linear_of(*baked, code)) + black, white),
                         lab_from_xyz(model->forward(drive) + black, white)));
      }
      EXPECT_LT(quantile(differences, 0.95), 0.05) << family.name;
      EXPECT_LT(*std::ranges::max_element(differences), 0.2) << family.name;
    }
  }
}

// What no fit would give.
class BadModel final : public ColourModel {
 public:
  explicit BadModel(Eigen::Matrix3d primaries) : primaries_(std::move(primaries)) {}
  [[nodiscard]] std::string_view name() const override { return "bad"; }
  [[nodiscard]] Xyz forward(const Vector3d& drive) const override {
    // NaN at half of red only.
    return primaries_ * drive / (std::abs(drive.x() - 51.0 / 255) < 1e-9 ? std::nan("") : 1.0);
  }
  [[nodiscard]] Eigen::Matrix3d jacobian(const Vector3d&) const override { return primaries_; }
  [[nodiscard]] bool is_additive() const override { return true; }
  [[nodiscard]] int parameters() const override { return 9; }

 private:
  Eigen::Matrix3d primaries_;
};

TEST(Baking, RefusesWhatMakesNoProfile) {
  const auto refused = [](const ColourModel& model, int bits) {
    const auto baked = bake(model, bits);
    return baked ? std::string() : baked.error().what;
  };
  const auto model = fit(colour_model_families().front(), {});
  ASSERT_NE(model, nullptr);
  EXPECT_NE(refused(*model, 0), "");
  EXPECT_NE(refused(*model, 17), "");
  EXPECT_EQ(refused(*model, 1), "");
  EXPECT_EQ(refused(*model, 16), "");
  EXPECT_NE(refused(BadModel(Eigen::Matrix3d::Ones()), 8), "");
  EXPECT_NE(refused(BadModel(Eigen::Matrix3d::Zero()), 8), "");
  EXPECT_NE(refused(BadModel(Eigen::Matrix3d::Identity()), 8).find("not finite"),
            std::string::npos);
}

}  // namespace
}  // namespace veneer::calibration
