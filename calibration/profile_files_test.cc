// SPDX-License-Identifier: Apache-2.0
#include "calibration/profile_files.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "calibration/exchange/cgats.h"
#include "calibration/exchange/cube.h"
#include "calibration/exchange/icc.h"

namespace veneer::calibration {
namespace {

/// A projector of 10 bits, near sRGB, with a white segment where asked for.
ProjectorProfile profile_of(bool white_segment) {
  ProjectorProfile profile;
  profile.geometry = {640, 480, 900, 900, 300, 420, {}};
  profile.bits = 10;
  for (auto& curve : profile.tone_curves) {
    for (int code = 0; code < 1024; ++code) curve.push_back(std::pow(code / 1023.0, 2.2));
  }
  profile.primaries = 300 * xyz_from_srgb();
  profile.black = {0.2, 0.25, 0.3};
  profile.vignetting = Image<float>(2, 2, 1.0F);
  if (white_segment)
    profile.residual = ColourResidual::sampled(33, [](const Eigen::Vector3d& t) -> Eigen::Vector3d {
      return Eigen::Vector3d::Constant(0.25 * t.minCoeff());
    });
  return profile;
}

/// What a drive sends, by the profile's own equation.
Xyz light_of(const ProjectorProfile& profile, const Eigen::Vector3d& drive) {
  const Eigen::Vector3d t = drive.unaryExpr([](double d) { return std::pow(d, 2.2); });
  return profile.emitted(t) + profile.black;
}

TEST(ProfileInverse, GivesBackTheDrive) {
  for (const bool white_segment : {false, true}) {
    const ProjectorProfile profile = profile_of(white_segment);
    ASSERT_TRUE(profile.check());
    const ProfileInverse inverse(profile);
    Pcg32 random(1);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d drive(random.uniform(), random.uniform(), random.uniform());
      const Xyz wanted = light_of(profile, drive);
      const Xyz shown = light_of(profile, inverse(wanted));
      // Straight lines between 1024 codes, and the correction's grid; see drive_correction_test.cc.
      EXPECT_LT(
          delta_e_2000(lab_from_xyz(wanted, profile.white()), lab_from_xyz(shown, profile.white())),
          white_segment ? 0.3 : 0.02)
          << drive.transpose();
    }
  }
}

TEST(ProfileInverse, CutsWhatIsOutOfReach) {
  const ProjectorProfile profile = profile_of(true);
  const ProfileInverse inverse(profile);
  EXPECT_EQ(inverse(Xyz::Zero()), Eigen::Vector3d::Zero());
  EXPECT_EQ(inverse(10 * profile.white()), Eigen::Vector3d::Ones());
}

TEST(ProfileFiles, SayTheSameAsTheProfile) {
  for (const bool white_segment : {false, true}) {
    const TemporaryFolder folder;
    const ProjectorProfile profile = profile_of(white_segment);
    const std::vector<PatchReading> readings{{{0, 0, 0}, {0.2, 0.25, 0.3}},
                                             {{1, 0.5, 0.25}, {100, 120, 80}}};
    const Status written = write_profile_files(profile, readings, "a colorimeter", folder.path());
    ASSERT_TRUE(written) << written.error().what;

    const auto back = read_ti3(folder.path() / "readings.ti3");
    ASSERT_TRUE(back) << back.error().what;
    EXPECT_EQ(back->instrument, "a colorimeter");
    ASSERT_EQ(back->patches.size(), 2U);
    EXPECT_LT((back->patches[1].xyz - readings[1].xyz).norm(), 1e-3);

    // The look-up table: what it makes the projector send is sRGB, all alike scaled.
    const auto cube = read_cube(folder.path() / "srgb_to_drive.cube");
    ASSERT_TRUE(cube) << cube.error().what;
    const Xyz white = light_of(profile, cube->values.back());
    // Of a white segment the pure colours fall short of the white and are cut; greys are not.
    constexpr int kGreyStep = 1 + 33 + 33 * 33;
    const std::vector<int> nodes =
        white_segment ? std::vector<int>{4 * kGreyStep, 16 * kGreyStep, 30 * kGreyStep}
                      : std::vector<int>{5, 40, 1000, 20000, 30000, 35900};
    for (const int node : nodes) {
      const int r = node % 33;
      const int g = node / 33 % 33;
      const int b = node / 33 / 33;
      const Eigen::Vector3d linear(
          srgb_decode(r / 32.0), srgb_decode(g / 32.0), srgb_decode(b / 32.0));
      const Xyz wanted = white.y() * (xyz_from_srgb() * linear);
      const Xyz shown = light_of(profile, cube->values[static_cast<std::size_t>(node)]);
      // Black is always there, and is all that dark and saturated colours are off by.
      EXPECT_LT((shown - wanted).norm(), 3e-3 * white.y()) << node;
    }
    EXPECT_LT((white / white.y() - xyz_from_srgb() * Eigen::Vector3d::Ones()).norm(), 0.01);

    const std::string icc = read_text(folder.path() / "projector.icc").value();
    const std::vector<Eigen::Vector3d> drives{{1, 1, 1}, {1, 0, 0}, {0.5, 0.5, 0.5}};
    const auto lab = evaluate_icc(icc, drives);
    ASSERT_TRUE(lab) << lab.error().what;
    EXPECT_NEAR(lab->front().l, 100, 0.5);
    EXPECT_GT((*lab)[1].a, 40);
    EXPECT_NE(read_text(folder.path() / "projector.yaml").value().find("camera_matrix"),
              std::string::npos);
    EXPECT_NE(read_text(folder.path() / "gl_projection.json").value().find("projection"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace veneer::calibration
