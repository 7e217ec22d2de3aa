// SPDX-License-Identifier: Apache-2.0
#include "calibration/maps/fall_off.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "base/random.h"
#include "calibration/maps/board_samples.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// What the fit leaves of smooth fall-offs without noise: log(1 - 0.5 q^2) is no polynomial, and
/// one of degree 8 follows it to 3e-4.
constexpr double kModelTolerance = 1e-3;
/// The accuracy that compensation needs of a fall-off: 1 % of light is 0.4 in L*, under what is
/// seen.
constexpr double kWanted = 0.01;
/// How well 30000 samples tell their own noise, of which the biweight takes the tails for outliers.
constexpr double kOfNoise = 0.03;

/// A projector, a camera and a board that is held in front of them, with formulas for all.
class FakeRig {
 public:
  ProjectorGeometry geometry{640, 480, 900, 900, 320, 260, {}};
  int camera_width = 800;
  int camera_height = 600;
  double camera_focal = 850;
  /// The camera stands to the projector's right and looks at what lies 1 m in front of it.
  RigidTransform projector_from_camera =
      look_at(Eigen::Vector3d(0.3, 0.05, 0), Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, -1, 0));
  Eigen::Vector2d board_half{0.3, 0.24};  // metres
  double drop = 0.18;                     // of the projector at a corner of the raster
  double exponent = 4;
  double camera_drop = 0;
  double noise = 0;  // relative
  double unlit = 40;
  double exposure = 20000;
  double outliers = 0;        // part of the samples that is on a glossy spot
  int step = 8;               // between the samples, projector pixels
  std::vector<double> gains;  // of the poses

  [[nodiscard]] double intensity(const Eigen::Vector2d& pixel) const {
    const auto raw = [&](const Eigen::Vector2d& at) {
      const Eigen::Vector2d off = (at - Eigen::Vector2d(340, 215)) / 400.0;
      const Eigen::Vector2d ray((at.x() - geometry.cx) / geometry.fx,
                                (at.y() - geometry.cy) / geometry.fy);
      return std::pow(1.0 + ray.squaredNorm(), -0.5 * exponent) * (1 - drop * off.squaredNorm());
    };
    return raw(pixel) / raw({320, 240});
  }
  [[nodiscard]] double camera_keeps(const Eigen::Vector2d& pixel) const {
    return 1 - camera_drop * (pixel - Eigen::Vector2d(400, 300)).squaredNorm() / 250000.0;
  }

  /// The board at places all over the raster, near and far, tilted all around.
  [[nodiscard]] static std::vector<RigidTransform> poses(int count) {
    std::vector<RigidTransform> made;
    for (int i = 0; i < count; ++i) {
      const double turn = 2.4 * i;  // the golden angle: no two alike
      const double distance = 0.8 + 0.5 * std::fmod(0.618 * i, 1.0);
      const double off = 0.16 * std::sqrt((i + 0.5) / count);
      const Eigen::Vector3d axis(std::cos(1.7 * turn), std::sin(1.7 * turn), 0);
      made.push_back({Eigen::Quaterniond(Eigen::AngleAxisd(0.4, axis)),
                      {off * 1.3 * std::cos(turn), off * std::sin(turn), distance}});
    }
    return made;
  }

  [[nodiscard]] std::vector<FallOffSample> see(const std::vector<RigidTransform>& boards) const {
    std::vector<FallOffSample> samples;
    Pcg32 random(11);
    const RigidTransform camera_from_projector = projector_from_camera.inverse();
    for (std::size_t pose = 0; pose < boards.size(); ++pose) {
      const RigidTransform board_from_projector = boards[pose].inverse();
      const Eigen::Vector3d normal = boards[pose].rotation * Eigen::Vector3d::UnitZ();
      for (int y = 0; y < geometry.height; y += step)
        for (int x = 0; x < geometry.width; x += step) {
          const Eigen::Vector2d pixel(x + 0.5, y + 0.5);
          const Eigen::Vector3d ray(
              (pixel.x() - geometry.cx) / geometry.fx, (pixel.y() - geometry.cy) / geometry.fy, 1);
          const Eigen::Vector3d point =
              ray * (normal.dot(boards[pose].translation) / normal.dot(ray));
          const Eigen::Vector3d on_board = board_from_projector * point;
          if ((on_board.head<2>().cwiseAbs().array() > board_half.array()).any()) continue;
          const Eigen::Vector3d seen = camera_from_projector * point;
          const Eigen::Vector2d camera(camera_focal * seen.x() / seen.z() + 0.5 * camera_width,
                                       camera_focal * seen.y() / seen.z() + 0.5 * camera_height);
          if ((camera.array() < 0).any() || camera.x() > camera_width || camera.y() > camera_height)
            continue;
          double light = exposure * (pose < gains.size() ? gains[pose] : 1.0);
          light *= std::abs(normal.dot(point.normalized())) / point.squaredNorm();
          light *= intensity(pixel) * camera_keeps(camera) * (1 + noise * random.normal());
          if (random.uniform() < outliers) light *= 1.2 + random.uniform();
          samples.push_back(
              {pixel, camera, light + unlit, unlit, point, normal, static_cast<int>(pose)});
        }
    }
    return samples;
  }

  [[nodiscard]] FallOffOptions options() const {
    FallOffOptions options;
    options.camera_width = camera_width;
    options.camera_height = camera_height;
    return options;
  }
  [[nodiscard]] Result<FallOff> measure(int count = 12) const {
    return measure_fall_off(see(poses(count)), geometry, options());
  }
  /// Relative error over the covered texels, root mean square.
  [[nodiscard]] double error(const FallOff& measured) const {
    double squares = 0;
    int texels = 0;
    const int width = measured.vignetting.width();
    const int height = measured.vignetting.height();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        if (measured.covered(x, y) == 0) continue;
        const double truth = intensity({(x + 0.5) / width * 640, (y + 0.5) / height * 480});
        squares += std::pow(measured.vignetting(x, y) / truth - 1, 2);
        ++texels;
      }
    return std::sqrt(squares / texels);
  }
};

std::string describe(const FallOff& f) {
  return fmt::format(
      "order {} camera {} residual {:.5f} held out {:.5f} inflation {:.2f} coverage {:.3f} "
      "outliers "
      "{} of {}",
      f.order,
      f.camera_terms,
      f.residual_rms,
      f.held_out_rms,
      f.inflation,
      f.coverage,
      f.outliers,
      f.fitted);
}

TEST(FallOff, IsFoundWithoutNoise) {
  for (const double drop : {0.0, 0.18, 0.5}) {
    for (const double camera_drop : {0.0, 0.3}) {
      FakeRig rig;
      rig.drop = drop;
      rig.camera_drop = camera_drop;
      const auto measured = rig.measure();
      ASSERT_TRUE(measured) << measured.error().what;
      EXPECT_LT(rig.error(*measured), kModelTolerance)
          << drop << ' ' << camera_drop << ": " << describe(*measured);
      EXPECT_THAT(measured->warnings, IsEmpty());
    }
  }
}

TEST(FallOff, IsFoundInNoiseAndGlossySpots) {
  for (const double drop : {0.18, 0.5}) {
    for (const double outliers : {0.0, 0.15}) {
      FakeRig rig;
      rig.drop = drop;
      rig.camera_drop = 0.3;
      rig.noise = 0.02;
      rig.outliers = outliers;
      const auto measured = rig.measure();
      ASSERT_TRUE(measured) << measured.error().what;
      EXPECT_LT(rig.error(*measured), kWanted)
          << drop << ' ' << outliers << ": " << describe(*measured);
      EXPECT_NEAR(measured->residual_rms, rig.noise, kOfNoise * rig.noise);
      EXPECT_NEAR(measured->held_out_rms, rig.noise, kOfNoise * rig.noise);
    }
  }
}

TEST(FallOff, IsOneAtTheCentreOfTheRasterAndCameraWhateverTheirCoverage) {
  FakeRig rig;
  rig.camera_drop = 0.3;
  const auto measured = rig.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  const Image<float>& map = measured->vignetting;
  // The centre is the corner of four texels.
  const double centre = 0.25 * (map(31, 23) + map(32, 23) + map(31, 24) + map(32, 24));
  EXPECT_NEAR(centre, 1.0, 1e-3);  // bilinear over the curvature of a texel
  EXPECT_EQ(measured->camera({400, 300}), 1.0);
  EXPECT_NEAR(measured->camera({0, 0}), rig.camera_keeps({0, 0}), kModelTolerance);
}

TEST(FallOff, DoesNotDependOnTheOrderOfSamplesNorOnTheSideOfTheNormal) {
  FakeRig rig;
  rig.noise = 0.02;
  auto samples = rig.see(FakeRig::poses(8));
  const auto one = measure_fall_off(samples, rig.geometry, rig.options());
  std::ranges::stable_sort(samples, std::ranges::greater{}, &FallOffSample::pose);
  for (FallOffSample& sample : samples) sample.normal_in_projector *= -3.0;
  const auto other = measure_fall_off(samples, rig.geometry, rig.options());
  ASSERT_TRUE(one && other);
  constexpr float kRounding = 1e-5F;  // the normal's length is divided out
  for (int y = 0; y < one->vignetting.height(); ++y)
    for (int x = 0; x < one->vignetting.width(); ++x)
      ASSERT_NEAR(one->vignetting(x, y), other->vignetting(x, y), kRounding) << x << ' ' << y;
}

TEST(FallOff, TellsTheGainOfEachPose) {
  FakeRig rig;
  rig.gains = {1.0, 0.7, 1.3, 1.0, 0.5, 1.1};
  const auto measured = rig.measure(6);
  ASSERT_TRUE(measured) << measured.error().what;
  ASSERT_EQ(measured->gains.size(), 6U);
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_NEAR(measured->gains[i], rig.gains[i], kModelTolerance) << i;
  EXPECT_LT(rig.error(*measured), kModelTolerance);
}

TEST(FallOff, OfOnePoseIsRefusedUnlessTheCameraIsCorrected) {
  FakeRig rig;
  rig.board_half = {1, 1};
  rig.noise = 0.01;
  rig.camera_focal = 500;  // so that it sees the whole raster
  rig.drop = 0.5;
  const std::vector<RigidTransform> pose{{Eigen::Quaterniond::Identity(), {0, 0, 1}}};
  const auto samples = rig.see(pose);
  FallOffOptions options = rig.options();
  const auto refused = measure_fall_off(samples, rig.geometry, options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadFormat);
  EXPECT_THAT(refused.error().what, HasSubstr("one pose"));
  options.fit_camera = false;
  const auto measured = measure_fall_off(samples, rig.geometry, options);
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_LT(rig.error(*measured), kWanted) << describe(*measured);
  EXPECT_EQ(measured->camera({0, 0}), 1.0);
  EXPECT_EQ(measured->inflation, 1.0);
  EXPECT_GT(measured->order, 2);  // a drop of one half is no parabola
  EXPECT_NEAR(measured->held_out_rms, rig.noise, kOfNoise * rig.noise);
}

TEST(FallOff, OfABoardThatAlwaysLiesAtTheSamePlaceIsRefused) {
  FakeRig rig;
  rig.camera_drop = 0.3;
  rig.noise = 0.01;
  std::vector<RigidTransform> poses;
  for (int i = 0; i < 8; ++i)  // as far as a hand shakes
    poses.push_back(
        {Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d(1, 1, 0).normalized())),
         {0.001 * (i % 3), 0, 1 + 0.001 * i}});
  const auto refused = measure_fall_off(rig.see(poses), rig.geometry, rig.options());
  ASSERT_FALSE(refused) << describe(*refused);
  EXPECT_THAT(refused.error().what, HasSubstr("cannot tell"));
  EXPECT_THAT(refused.error().what, HasSubstr("different distances"));
}

TEST(FallOff, IsFoundFromTwoPosesThatDiffer) {
  FakeRig rig;
  rig.camera_drop = 0.3;
  rig.board_half = {0.6, 0.5};
  const std::vector<RigidTransform> poses{{Eigen::Quaterniond::Identity(), {0, 0, 0.8}},
                                          {Eigen::Quaterniond::Identity(), {0, 0, 1.4}}};
  const auto measured = measure_fall_off(rig.see(poses), rig.geometry, rig.options());
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_LT(rig.error(*measured), kWanted) << describe(*measured);
}

TEST(FallOff, CountsWhatItCannotUse) {
  FakeRig rig;
  auto samples = rig.see(FakeRig::poses(6));
  const auto clean = measure_fall_off(samples, rig.geometry, rig.options());
  ASSERT_TRUE(clean) << clean.error().what;
  const double nan = std::nan("");
  const double inf = std::numeric_limits<double>::infinity();
  std::vector<FallOffSample> bad(10, samples.front());
  bad[0].lit = nan;
  bad[1].unlit = inf;
  bad[2].projector.x() = nan;
  bad[3].projector.x() = 641;
  bad[4].x_in_projector.z() = nan;
  bad[5].normal_in_projector.setZero();
  bad[6].x_in_projector.setZero();
  bad[7].lit = 65535;
  bad[8].lit = bad[8].unlit;  // no light: its logarithm is out of reach
  bad[9].normal_in_projector = bad[9].x_in_projector.unitOrthogonal();
  samples.insert(samples.end(), bad.begin(), bad.end());
  const auto measured = measure_fall_off(samples, rig.geometry, rig.options());
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_EQ(measured->not_finite, 7);
  EXPECT_EQ(measured->saturated, 1);
  EXPECT_EQ(measured->dark, 1);
  EXPECT_EQ(measured->grazing, 1);
  EXPECT_EQ(measured->used, clean->used);
  EXPECT_EQ(measured->used, static_cast<std::int64_t>(samples.size() - bad.size()));
  for (int y = 0; y < clean->vignetting.height(); ++y)
    for (int x = 0; x < clean->vignetting.width(); ++x)
      ASSERT_EQ(measured->vignetting(x, y), clean->vignetting(x, y));
}

TEST(FallOff, OfNothingUsefulIsRefusedWithCounts) {
  const FakeRig rig;
  auto samples = rig.see(FakeRig::poses(6));
  EXPECT_THAT(measure_fall_off({}, rig.geometry, rig.options()).error().what,
              HasSubstr("of 0 samples 0 are of use"));
  for (FallOffSample& sample : samples) sample.lit = 70000;
  const auto refused = measure_fall_off(samples, rig.geometry, rig.options());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadFormat);
  EXPECT_THAT(refused.error().what, HasSubstr(fmt::format("{} saturated", samples.size())));
}

TEST(FallOff, IsBoundedAndSaidToBeExtrapolatedWhereNoBoardWas) {
  FakeRig rig;
  rig.drop = 0.5;
  rig.camera_drop = 0.2;
  rig.noise = 0.01;
  auto samples = rig.see(FakeRig::poses(12));
  std::erase_if(samples, [](const FallOffSample& s) { return s.projector.x() > 400; });
  const auto measured = measure_fall_off(samples, rig.geometry, rig.options());
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_LT(rig.error(*measured), kWanted) << describe(*measured);
  // 400 of 640 pixels and the radius that is covered around a sample.
  EXPECT_NEAR(measured->coverage, 400.0 / 640 + 2.0 / 64, 0.02);
  EXPECT_NEAR(measured->most_extrapolated, (240 - 20) / 400.0, 0.03);
  ASSERT_FALSE(measured->warnings.empty());
  EXPECT_THAT(measured->warnings.front(), HasSubstr("extrapolated"));
  EXPECT_EQ(measured->covered(63, 24), 0);
  // Nothing runs away: a parabola is not far off where the fall-off is none.
  for (int y = 0; y < measured->vignetting.height(); ++y)
    for (int x = 0; x < measured->vignetting.width(); ++x) {
      const double truth = rig.intensity({(x + 0.5) * 10, (y + 0.5) * 10});
      EXPECT_NEAR(measured->vignetting(x, y), truth, 0.15) << x << ' ' << y;
    }
}

TEST(FallOff, OptionsOutOfRangeAreRefused) {
  const FakeRig rig;
  const auto refuses = [&](const std::function<void(FallOffOptions&)>& spoil,
                           std::string_view name) {
    FallOffOptions options = rig.options();
    spoil(options);
    const auto refused = measure_fall_off({}, rig.geometry, options);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
    EXPECT_THAT(refused.error().what, HasSubstr(std::string(name)));
  };
  const double nan = std::nan("");
  refuses([](auto& o) { o.camera_width = 0; }, "camera");
  refuses([&](auto& o) { o.full_scale = nan; }, "full_scale");
  refuses([](auto& o) { o.least_light = 1; }, "least_light");
  refuses([&](auto& o) { o.least_cosine = nan; }, "least_cosine");
  refuses([](auto& o) { o.most_inflation = 1; }, "most_inflation");
  refuses([](auto& o) { o.most_samples = 10; }, "most_samples");
  ProjectorGeometry none;
  EXPECT_EQ(measure_fall_off({}, none, rig.options()).error().code, Errc::kInvalidOption);
}

TEST(BoardSamples, LieWhereTheRayOfTheirPixelMeetsTheBoard) {
  const ProjectorGeometry geometry{640, 480, 900, 900, 320, 260, {}};
  const RigidTransform projector_from_board{
      Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX())), {0.05, 0.02, 1.1}};
  Image<Rgb16> lit(40, 30, {100, 200, 300});
  Image<Rgb16> unlit(40, 30, {1, 2, 3});
  const float nan = std::nanf("");
  Image<Eigen::Vector2f> projector(40, 30, Eigen::Vector2f(nan, nan));
  projector(4, 7) = {300, 250};
  projector(8, 7) = {340, 250};
  projector(9, 7) = {342, 250};  // between the pixels that are taken
  const auto samples = [&](const std::function<bool(const Eigen::Vector2d&)>& is_white) {
    return board_samples(lit.view(),
                         unlit.view(),
                         projector.view(),
                         geometry,
                         projector_from_board,
                         is_white,
                         1,
                         4,
                         5);
  };
  EXPECT_THAT(samples({}), IsEmpty());  // rows 2, 6, 10: not 7
  for (const int x : {6, 10, 11}) projector(x, 6) = projector(x - 2, 7);
  const auto found = samples({});
  ASSERT_EQ(found.size(), 2U);
  for (const FallOffSample& s : found) {
    EXPECT_EQ(s.lit, 200);
    EXPECT_EQ(s.unlit, 2);
    EXPECT_EQ(s.pose, 5);
    EXPECT_EQ(s.camera, Eigen::Vector2d(s.projector.x() == 300 ? 6.5 : 10.5, 6.5));
    const Eigen::Vector3d on_board = projector_from_board.inverse() * s.x_in_projector;
    EXPECT_NEAR(on_board.z(), 0, 1e-12);
    EXPECT_NEAR(900 * s.x_in_projector.x() / s.x_in_projector.z() + 320, s.projector.x(), 1e-9);
    EXPECT_NEAR(900 * s.x_in_projector.y() / s.x_in_projector.z() + 260, s.projector.y(), 1e-9);
    EXPECT_NEAR(s.normal_in_projector.norm(), 1, 1e-12);
  }
  EXPECT_EQ(samples([](const Eigen::Vector2d& point) { return point.x() > -0.05; }).size(), 1U);
}

}  // namespace
}  // namespace veneer::calibration
