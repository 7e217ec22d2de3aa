// SPDX-License-Identifier: Apache-2.0
#include "calibration/radiometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "base/random.h"
#include "calibration/colour/colour_patches.h"
#include "calibration/verification.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

/// A projector that obeys the profile's model exactly, with formulas instead of tables.
class FakeProjector final : public Colorimeter, public PatchDisplay {
 public:
  ProjectorGeometry geometry{640, 480, 900, 900, 300, 420, {}};
  int bits = 8;
  double reference_distance_m = 1.3;
  Eigen::Matrix3d primaries =
      (Eigen::Matrix3d() << 330, 250, 140, 160, 580, 60, 10, 70, 760).finished();
  Xyz black{0.8, 0.9, 1.2};
  Xyz ambient{2.2, 2.0, 1.6};
  Eigen::Matrix3d surface =
      (Eigen::Matrix3d() << 0.8, 0.02, 0.01, 0.01, 0.78, 0, 0, 0.01, 0.7).finished();
  double noise = 0;  // relative
  std::function<Xyz(const Xyz&)> spoil = [](const Xyz& xyz) { return xyz; };
  std::function<Eigen::Vector3d(Eigen::Vector3d)> drive_hook = [](Eigen::Vector3d d) { return d; };
  int timeouts = 0;  // readings that time out before the next one succeeds

  static double tone(int channel, double drive) {
    if (channel == 1) return 1.4 * std::pow(drive, 2.6) / (std::pow(drive, 2.4) + 0.4);
    return std::pow(drive, channel == 0 ? 2.2 : 1.8);
  }
  [[nodiscard]] double intensity(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d off = (pixel - Eigen::Vector2d(320, 240)) / 400.0;
    return 1.0 - 0.2 * off.squaredNorm() + 0.05 * off.x();
  }
  [[nodiscard]] double slant(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d ray((pixel.x() - geometry.cx) / geometry.fx,
                              (pixel.y() - geometry.cy) / geometry.fy);
    return std::pow(1.0 + ray.squaredNorm(), -1.5);
  }

  std::string description() const override { return "fake colorimeter"; }
  Status show(const Rgb16& code, bool lit) override {
    code_ = code;
    lit_ = lit;
    return {};
  }
  Status show_picture(ImageView<const Rgb16>) override {
    return fail(Errc::kInvalidOption, "only patches are shown here");
  }
  Result<Xyz> read(Target target, const Eigen::Vector2d& pixel) override {
    if (timeouts > 0) {
      --timeouts;
      return fail(Errc::kTimeout, "no answer");
    }
    Xyz light = ambient;
    if (lit_) {
      Eigen::Vector3d drive;
      for (int c = 0; c < 3; ++c)
        drive[c] = code_[static_cast<std::size_t>(c)] / (std::ldexp(1.0, bits) - 1);
      drive = drive_hook(drive);
      Eigen::Vector3d output;
      for (int c = 0; c < 3; ++c) output[c] = tone(c, drive[c]);
      light += intensity(pixel) * slant(pixel) * (primaries * output + black);
    }
    if (target == Target::kObject) light = surface * light;
    return spoil(Xyz(light * (1.0 + noise * random_.normal())));
  }

  Result<MeasuredProfile> measure(RadiometryOptions options = {}) {
    options.bits = bits;
    options.reference_distance_m = reference_distance_m;
    SilentProgress progress;
    return measure_profile(*this, *this, geometry, options, progress);
  }
  Result<ProfileVerification> verify(const ProjectorProfile& profile) {
    SilentProgress progress;
    return verify_profile(
        *this, *this, profile, verification_patches(profile, 200, 99), {1}, progress);
  }
  void expect_refused(std::string_view reason) {
    const auto measured = measure();
    ASSERT_FALSE(measured);
    EXPECT_EQ(measured.error().code, Errc::kBadFormat);
    EXPECT_THAT(measured.error().what, HasSubstr(std::string(reason)));
  }

 private:
  std::array<std::uint16_t, 3> code_{};
  bool lit_ = true;
  Pcg32 random_{7};
};

TEST(RampCodes, AreDifferentRiseAndEndAtFullDrive) {
  for (const int bits : {3, 8, 10, 16}) {
    for (const int levels : {4, 7, 20, 100}) {
      if (levels > (1 << bits) - 1) continue;
      const auto codes = ramp_codes(bits, levels);
      ASSERT_EQ(codes.size(), static_cast<std::size_t>(levels));
      EXPECT_EQ(std::set<int>(codes.begin(), codes.end()).size(), codes.size());
      EXPECT_TRUE(std::ranges::is_sorted(codes));
      EXPECT_GT(codes.front(), 0);
      EXPECT_EQ(codes.back(), (1 << bits) - 1);
    }
  }
}

TEST(MeasureProfile, FindsTheTruthWithoutNoise) {
  FakeProjector projector;
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  const ProjectorProfile& p = measured->profile;
  constexpr double kExact = 1e-9;  // linear algebra only
  EXPECT_TRUE(p.primaries.isApprox(projector.primaries * projector.intensity({320, 240}), kExact));
  EXPECT_TRUE(p.black.isApprox(projector.black, kExact)) << p.black.transpose();
  EXPECT_TRUE(p.ambient.isApprox(projector.ambient, kExact));
  EXPECT_TRUE(p.surface.isApprox(projector.surface, kExact)) << p.surface;
  EXPECT_NEAR(measured->additivity_error, 0, kExact);
  EXPECT_NEAR(measured->ambient_mismatch, 0, kExact);
  EXPECT_TRUE(measured->warnings.empty());
  constexpr double kBetweenLevels = 1.5e-3;  // a cubic over 20 levels; measured 6e-4
  for (int c = 0; c < 3; ++c)
    for (std::size_t code = 0; code < 256; ++code)
      EXPECT_NEAR(p.tone_curves.at(static_cast<std::size_t>(c))[code],
                  FakeProjector::tone(c, static_cast<double>(code) / 255.0),
                  kBetweenLevels)
          << "channel " << c << " code " << code;
}

TEST(MeasureProfile, FindsTheVignettingInALightRoom) {
  FakeProjector projector;
  projector.ambient = {150, 160, 140};
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  const Image<float>& map = measured->profile.vignetting;
  const double reference = projector.intensity({320, 240});
  for (int y = 0; y < map.height(); ++y)
    for (int x = 0; x < map.width(); ++x) {
      const Eigen::Vector2d pixel((x + 0.5) / map.width() * 640, (y + 0.5) / map.height() * 480);
      // Cubics through a parabola are exact; the rim beyond the outermost spots is a straight line.
      const bool rim = (pixel - Eigen::Vector2d(320, 240)).cwiseAbs().x() > 300 ||
                       (pixel - Eigen::Vector2d(320, 240)).cwiseAbs().y() > 225;
      EXPECT_NEAR(map(x, y), projector.intensity(pixel) / reference, rim ? 2e-3 : 1e-6)
          << x << ' ' << y;
    }
}

TEST(MeasureProfile, DoesNotOvershootAStep) {
  FakeProjector projector;
  projector.drive_hook = [](Eigen::Vector3d d) {
    for (double& drive : d) drive = drive < 0.5 ? 0.3 * drive : 0.7 + 0.6 * (drive - 0.5);
    return d;
  };
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  const std::vector<double>& curve = measured->profile.tone_curves[0];
  const std::vector<std::uint16_t> levels = ramp_codes(8, RadiometryOptions{}.levels);
  // A curve that overshot or undershot would have been cut, and so be flat half way between levels.
  std::size_t below = 0;
  for (const std::size_t level : levels) {
    const std::size_t middle = (below + level) / 2;
    if (middle > below && curve[level] > curve[below]) {
      EXPECT_GT(curve[middle], curve[below]) << middle;
      EXPECT_LT(curve[middle], curve[level]) << middle;
    }
    below = level;
  }
}

TEST(MeasureProfile, PredictsPatchesItHasNotSeen) {
  FakeProjector projector;
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  const auto verified = projector.verify(measured->profile);
  ASSERT_TRUE(verified) << verified.error().what;
  EXPECT_EQ(verified->patches.size(), 200U);
  EXPECT_LT(verified->de00_mean, 0.15);
  EXPECT_LE(verified->de00_mean, verified->de00_p95);
  EXPECT_LE(verified->de00_p95, verified->de00_max);
  EXPECT_LT(verified->de00_max, 1.0);
}

TEST(MeasureProfile, StandsNoiseTimeoutsAndTenBits) {
  FakeProjector projector;
  projector.noise = 0.003;  // the noise of the literature's ladder of models
  projector.bits = 10;
  projector.timeouts = 2;
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_EQ(measured->profile.tone_curves[0].size(), 1024U);
  const auto verified = projector.verify(measured->profile);
  ASSERT_TRUE(verified) << verified.error().what;
  EXPECT_LT(verified->de00_mean, 0.6);
}

TEST(MeasureProfile, AcceptsAProjectorWithoutBlackInADarkRoom) {
  FakeProjector projector;
  projector.black.setZero();
  projector.ambient.setZero();
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_TRUE(measured->profile.black.isZero());
  EXPECT_EQ(measured->ambient_mismatch, 0);
}

TEST(MeasureProfile, WarnsOfAWhiteSegment) {
  FakeProjector projector;
  // White light grows faster than its parts: what a white segment or boosting does.
  projector.drive_hook = [](Eigen::Vector3d d) {
    return Eigen::Vector3d(d * (1.0 + 0.05 * d.minCoeff()));
  };
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_LT(measured->additivity_error, -0.03);
  ASSERT_EQ(measured->warnings.size(), 1U);
  EXPECT_THAT(measured->warnings.front(), HasSubstr("do not add up"));
}

TEST(MeasureProfile, WarnsOfAmbientLightThatTheObjectSeesDifferently) {
  FakeProjector projector;
  // Only the object's share of the ambient light is spoilt: those are the only readings this dark.
  const double dim = (projector.surface * projector.ambient).y();
  projector.spoil = [dim](const Xyz& xyz) {
    return std::abs(xyz.y() - dim) < 1e-9 ? Xyz(1.5 * xyz) : xyz;
  };
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_NEAR(measured->ambient_mismatch, 0.5, 1e-6);
  ASSERT_EQ(measured->warnings.size(), 1U);
  EXPECT_THAT(measured->warnings.front(), HasSubstr("ambient"));
}

TEST(MeasureProfile, RefusesADeadChannelByName) {
  FakeProjector projector;
  projector.drive_hook = [](Eigen::Vector3d d) { return Eigen::Vector3d(d.x(), 0, d.z()); };
  projector.expect_refused("green is dead");
}

TEST(MeasureProfile, RefusesALampThatIsOff) {
  FakeProjector projector;
  projector.drive_hook = [](const Eigen::Vector3d&) { return Eigen::Vector3d(0, 0, 0); };
  projector.expect_refused("no channel gives light");
}

TEST(MeasureProfile, RefusesARampThatFalls) {
  FakeProjector projector;
  projector.drive_hook = [](Eigen::Vector3d d) {
    if (d.z() > 0.6 && d.z() < 0.75) d.z() = 0.5;
    return d;
  };
  projector.expect_refused("tone curve of blue");
}

TEST(MeasureProfile, RefusesReadingsThatAreNoNumbers) {
  FakeProjector projector;
  int reading = 0;
  projector.spoil = [&reading](const Xyz& xyz) {
    return ++reading == 30 ? Xyz(xyz.x(), std::numeric_limits<double>::quiet_NaN(), 0) : xyz;
  };
  projector.expect_refused("not a number");
}

TEST(MeasureProfile, RefusesABlackDarkerThanTheLampOff) {
  FakeProjector projector;
  projector.black = {-20, -20, -20};
  projector.expect_refused("darker than");
}

TEST(MeasureProfile, RefusesAnObjectThatReflectsNothing) {
  FakeProjector projector;
  projector.surface.setZero();
  projector.expect_refused("surface");
}

TEST(MeasureProfile, RefusesTwoEqualPrimaries) {
  FakeProjector projector;
  projector.primaries.col(2) = projector.primaries.col(1);
  projector.expect_refused("colour");
}

TEST(MeasureProfile, GivesUpAfterRepeatedTimeouts) {
  FakeProjector projector;
  projector.timeouts = 3;
  const auto measured = projector.measure();
  ASSERT_FALSE(measured);
  EXPECT_EQ(measured.error().code, Errc::kTimeout);
}

TEST(MeasureProfile, RefusesOptionsOutOfRange) {
  const auto refuses = [](const std::function<void(RadiometryOptions&)>& spoil, const char* name) {
    RadiometryOptions options;
    spoil(options);
    const Status status = options.check();
    ASSERT_FALSE(status) << name;
    EXPECT_EQ(status.error().code, Errc::kInvalidOption);
    EXPECT_THAT(status.error().what, HasSubstr(name));
  };
  refuses([](auto& o) { o.bits = 17; }, "bits");
  refuses([](auto& o) { o.reference_distance_m = 0; }, "reference_distance_m");
  refuses([](auto& o) { o.reference_distance_m = std::nan(""); }, "reference_distance_m");
  refuses([](auto& o) { o.levels = 256; }, "levels");
  refuses([](auto& o) { o.repeats = 0; }, "repeats");
  refuses([](auto& o) { o.patch_repeats = 0; }, "patch_repeats");
  refuses([](auto& o) { o.held_out = 7; }, "held_out");
  refuses([](auto& o) { o.cube = 1; }, "cube");
  refuses([](auto& o) { o.vignetting_columns = 1; }, "vignetting_columns");
  refuses([](auto& o) { o.vignetting_rows = 101; }, "vignetting_rows");
}

// The map is diagonal in the primaries: on the object, each primary alone comes back with its own
// factor and its own colour, ambient light is split into the three, and the board knows no map.
TEST(PredictReading, TakesTheObjectsReflectanceAtThePixel) {
  FakeProjector projector;
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_TRUE(measured->profile.surface_map.empty());
  const ProjectorProfile& even = measured->profile;
  ProjectorProfile patterned = even;
  patterned.surface_map = Image<Rgb32f>(2, 1, Rgb32f::Ones());
  patterned.surface_map(1, 0) = Rgb32f(0.5F, 0.25F, 2.0F);
  constexpr double kRounding = 1e-12;
  const Eigen::Vector2d left(100, 200);  // nearer to the edge than the first texel's centre
  const Eigen::Vector2d right(600, 200);
  const auto of_object = [](const ProjectorProfile& p,
                            const Eigen::Vector2d& pixel,
                            const std::array<std::uint16_t, 3>& code,
                            bool lit) {
    return predict_reading(p, Target::kObject, pixel, code, lit);
  };
  EXPECT_TRUE(of_object(patterned, left, {200, 100, 50}, true)
                  .isApprox(of_object(even, left, {200, 100, 50}, true), kRounding));
  const Xyz board = predict_reading(patterned, Target::kWhiteReference, right, {200, 100, 50});
  EXPECT_EQ(board, predict_reading(even, Target::kWhiteReference, right, {200, 100, 50}));
  const std::array<std::array<std::uint16_t, 3>, 3> primaries{
      {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}}};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto added = [&](const ProjectorProfile& p) -> Xyz {
      return of_object(p, right, primaries[c], true) - of_object(p, right, {0, 0, 0}, true);
    };
    const double factor = patterned.surface_map(1, 0)[static_cast<int>(c)];
    EXPECT_TRUE(added(patterned).isApprox(factor * added(even), kRounding)) << c;
  }
  // Ambient light of the green primary's colour comes back with green's factor.
  patterned.ambient = patterned.primaries.col(1);
  EXPECT_TRUE(of_object(patterned, right, {0, 0, 0}, false)
                  .isApprox(0.25 * patterned.surface * patterned.ambient, kRounding));
}

TEST(VerifyProfile, NoticesAProfileOfAnotherProjector) {
  FakeProjector projector;
  auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  measured->profile.primaries.col(0).swap(measured->profile.primaries.col(2));
  const auto verified = projector.verify(measured->profile);
  ASSERT_TRUE(verified) << verified.error().what;
  EXPECT_GT(verified->de00_mean, 5.0);
}

TEST(VerifyProfile, RefusesAnEmptyList) {
  FakeProjector projector;
  const auto measured = projector.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  SilentProgress progress;
  const auto verified = verify_profile(projector, projector, measured->profile, {}, {}, progress);
  ASSERT_FALSE(verified);
  EXPECT_EQ(verified.error().code, Errc::kInvalidOption);
}

}  // namespace
}  // namespace veneer::calibration
