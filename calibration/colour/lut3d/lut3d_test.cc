// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/lut3d/lut3d.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "calibration/colour/internal_testing.h"
#include "calibration/colour/lut3d/tetrahedral_lut.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

const std::vector<double> kAxis{0.0, 0.1, 0.4, 1.0};
const std::array<std::vector<double>, 3> kAxes{kAxis, kAxis, kAxis};

TetrahedralLut sampled(const std::function<Xyz(const Vector3d&)>& colour) {
  std::vector<Xyz> values;
  for (const double b : kAxis) {
    for (const double g : kAxis) {
      for (const double r : kAxis) values.push_back(colour({r, g, b}));
    }
  }
  return {kAxes, std::move(values)};
}

TEST(TetrahedralLut, IsExactForWhatIsLinearAndReturns) {
  Eigen::Matrix3d matrix;
  matrix << 0.4, 0.3, 0.2, 0.2, 0.7, 0.1, 0.0, 0.1, 0.9;
  const TetrahedralLut lut = sampled([&](const Vector3d& t) -> Xyz { return matrix * t; });
  Pcg32 random(1);
  for (int i = 0; i < 500; ++i) {
    const Vector3d t = random_drive(random);
    EXPECT_LT((lut(t) - matrix * t).norm(), 1e-14) << t.transpose();
    EXPECT_LT((lut.slope_at(t) - matrix).norm(), 1e-12) << t.transpose();
    const auto back = lut.inverse(matrix * t);
    ASSERT_TRUE(back.has_value()) << t.transpose();
    EXPECT_LT((*back - t).norm(), 1e-9) << t.transpose();
  }
}

TEST(TetrahedralLut, ReturnsFromEveryNodeAndFace) {
  const TetrahedralLut lut = sampled(
      [](const Vector3d& t) -> Xyz { return t + 0.1 * Xyz(t[1] * t[2], t[0] * t[2], t.prod()); });
  for (const double r : {0.0, 0.1, 0.25, 0.4, 1.0}) {
    for (const double g : {0.0, 0.1, 0.25, 0.4, 1.0}) {
      for (const double b : {0.0, 0.1, 0.25, 0.4, 1.0}) {
        const Vector3d t(r, g, b);
        const auto back = lut.inverse(lut(t));
        ASSERT_TRUE(back.has_value()) << t.transpose();
        EXPECT_LT((lut(*back) - lut(t)).norm(), 1e-8) << t.transpose();
      }
    }
  }
}

TEST(TetrahedralLut, EndsAndIsRightForValuesInAnyOrder) {
  Pcg32 random(2);
  for (int trial = 0; trial < 20; ++trial) {
    const TetrahedralLut lut =
        sampled([&](const Vector3d&) -> Xyz { return random_drive(random); });
    for (int i = 0; i < 20; ++i) {
      // Somewhere in the cube it is this colour, though not only there.
      const Xyz xyz = lut(random_drive(random));
      const auto back = lut.inverse(xyz);
      ASSERT_TRUE(back.has_value());
      EXPECT_LT((lut(*back) - xyz).norm(), 1e-6);
      EXPECT_FALSE(lut.inverse({2, 2, 2}).has_value());
    }
  }
}

TEST(TetrahedralLut, HasNothingForNanNorForAFlatCube) {
  const TetrahedralLut flat = sampled([](const Vector3d&) -> Xyz { return {1, 1, 1}; });
  EXPECT_FALSE(flat.inverse({1, 1, 2}).has_value());
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(flat.inverse({std::nan(""), 1, 1}).has_value());
  EXPECT_FALSE(flat.inverse({infinity, 1, 1}).has_value());
  EXPECT_TRUE(flat({std::nan(""), 0, 0}).hasNaN());
}

TEST(Lut3d, HasWhatWasReadAtItsNodes) {
  const ExampleReadings readings = example_readings(kEveryDefect, 0.003);
  const auto model = fit_lut3d(readings.patches, readings.black);
  ASSERT_TRUE(model.has_value()) << model.error().what;
  ColourPatchOptions cube;
  cube.grey_levels = 0;
  for (const PatchReading& patch : readings.patches) {
    for (const Rgb16& node : interaction_patches(cube)) {
      if (drive_of_code(node, 8) != patch.drive) continue;
      EXPECT_LT(((*model)->forward(patch.drive) + readings.black - patch.xyz).norm(),
                1e-9 * patch.xyz.norm())
          << patch.drive.transpose();
    }
  }
}

TEST(Lut3d, SaysHowManyMixturesAreMissing) {
  ExampleReadings readings = example_readings({});
  const auto mixed = [](const PatchReading& patch) {
    return patch.drive.minCoeff() > 0.0 && patch.drive.maxCoeff() == 1.0 &&
           patch.drive.minCoeff() < 1.0;
  };
  const auto missing = std::erase_if(readings.patches, mixed);
  ASSERT_GT(missing, 0U);
  const auto model = fit_lut3d(readings.patches, readings.black);
  ASSERT_FALSE(model.has_value());
  EXPECT_NE(model.error().what.find(fmt::format("{} of the 64 mixtures", missing)),
            std::string::npos)
      << model.error().what;
}

}  // namespace
}  // namespace veneer::calibration
