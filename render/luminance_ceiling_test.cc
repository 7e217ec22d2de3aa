// SPDX-License-Identifier: Apache-2.0
#include "render/luminance_ceiling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "render/compensation.h"
#include "render/egl_context.h"
#include "render/internal_testing.h"
#include "render/prepared_profile.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;
using Codes = std::array<std::uint16_t, 3>;

const Vector3d kEven = Vector3d::Ones();  // a surface without a map

calibration::ProjectorProfile profile_of(bool with_residual, int bits = 8) {
  auto profile = example_profile(64, 48, bits);
  if (with_residual) profile.residual = example_residual();
  return profile;
}
// What the profile says that codes send, by its own words.
double sent_nits(const calibration::ProjectorProfile& profile, const Codes& codes) {
  return profile.emitted(profile.linear_drive(codes)).y() + profile.black.y();
}
// With a residual the drive is read from a table for the light wanted. On the border of the gamut,
// where what is too bright mostly lies, it is off by this, of full drive (measured: 0.002),
constexpr double kTableError = 5e-3;
// and inside by this to the eye (DriveCorrection::kNodes; measured here: 0.12).
constexpr double kTableDifference = 0.3;  // dE00
// A primary that drifts has another hue where it is weaker: scaled down, the light of a full one is
// out of gamut, and a channel stops at 0 (measured: 1.6).
constexpr double kDriftDifference = 2.5;

// From black to far beyond white.
Xyz random_target(Pcg32& random) {
  const double scale = 600.0 * std::pow(random.uniform(), 2);
  const double x = random.uniform();
  const double y = random.uniform();
  return scale * Xyz(x, y, random.uniform());
}

TEST(LuminanceCeiling, SaysWhatTheProfileSays) {
  Pcg32 random(1);
  for (const bool with_residual : {false, true}) {
    const auto profile = profile_of(with_residual, 10);
    const LuminanceCeiling ceiling(profile, 100);
    for (int i = 0; i < 2000; ++i) {
      Codes codes{};
      for (auto& code : codes) code = static_cast<std::uint16_t>(random.next() & 1023U);
      ASSERT_NEAR(ceiling.luminance(codes), sent_nits(profile, codes), 1e-9);
      ASSERT_EQ(ceiling.allows(codes), ceiling.luminance(codes) <= ceiling.limit());
    }
  }
  EXPECT_FALSE(LuminanceCeiling().active());
  EXPECT_FALSE(LuminanceCeiling(profile_of(false), 0).active());
}

TEST(LuminanceCeiling, NothingGoesOverItAndWhatIsUnderItStays) {
  for (const bool with_residual : {false, true})
    for (const bool compensate : {true, false})
      for (const bool dither : {true, false}) {
        const auto profile = profile_of(with_residual);
        RendererOptions options{.compensate = compensate, .dither = dither};
        const Compensation open(profile, options);
        for (const double nits : {0.11, 0.5, 4.0, 40.0, 150.0}) {
          options.luminance_ceiling = nits;
          const Compensation held(profile, options);
          Pcg32 random(2);
          int held_count = 0;
          for (std::uint32_t i = 0; i < 1500; ++i) {
            const Xyz target = random_target(random);
            const double g = 0.1 + 1.2 * random.uniform();
            const auto without = open.pixel(target, g, 0.9, kEven, i, 2 * i, i);
            const auto with = held.pixel(target, g, 0.9, kEven, i, 2 * i, i);
            ASSERT_LE(sent_nits(profile, with.codes), nits) << target.transpose();
            ASSERT_EQ(with.state, without.state);
            ASSERT_EQ(with.gamut_loss, without.gamut_loss);
            ASSERT_FALSE(without.held);
            held_count += with.held ? 1 : 0;
            if (with.held) {
              // No channel is brighter than it would have been.
              ASSERT_LE((with.drive - without.drive).maxCoeff(), with_residual ? kTableError : 0.0)
                  << target.transpose();
            } else {
              ASSERT_EQ(with.codes, without.codes) << target.transpose();
              ASSERT_EQ(with.drive, without.drive);
            }
            if (sent_nits(profile, without.codes) > nits) {
              ASSERT_TRUE(with.held) << target.transpose();
            }
          }
          EXPECT_GT(held_count, 100) << nits;
        }
      }
}

// One factor for all that is sent above black. With a residual the drive is read from a table for
// the light wanted, which DriveCorrection meets within 0.3 dE00; a hundredth of the light is more.
TEST(LuminanceCeiling, KeepsHueAndComesAsNearAsCodesAllow) {
  for (const bool with_residual : {false, true}) {
    const auto profile = profile_of(with_residual);
    const Compensation open(profile, {});
    for (const double nits : {5.0, 60.0}) {
      const Compensation held(profile, {.luminance_ceiling = nits});
      Pcg32 random(3);
      int compared = 0;
      for (std::uint32_t i = 0; i < 2000; ++i) {
        const Xyz target = random_target(random);
        const auto without = open.pixel(target, 1.0, 1.0, kEven, i, i, i);
        const auto with = held.pixel(target, 1.0, 1.0, kEven, i, i, i);
        if (!with.held) continue;
        ++compared;
        const Vector3d full = without.drive + profile.residual(without.drive);
        const Vector3d less = with.drive + profile.residual(with.drive);
        const double factor = less.dot(full) / full.squaredNorm();
        ASSERT_LT(factor, 1.0);
        if (with_residual) {
          const Xyz white = profile.white();
          const auto lab = [&](const Vector3d& light) {
            return lab_from_xyz(profile.primaries * light + profile.black, white);
          };
          const bool in_gamut = with.drive.minCoeff() > 0.0;
          ASSERT_LT(delta_e_2000(lab(less), lab(factor * full)),
                    in_gamut ? kTableDifference : kDriftDifference)
              << target.transpose();
        } else {
          ASSERT_LT((less - factor * full).norm(), 1e-12) << target.transpose();
        }
        // Another level in every channel would be over it: dither has all the room there is.
        Codes next{};
        for (std::size_t c = 0; c < 3; ++c) {
          const auto bracket = held.tone_levels()[c].bracket(with.drive[static_cast<int>(c)]);
          next[c] = static_cast<std::uint16_t>(std::min(bracket.upper + 1, 255));
        }
        ASSERT_GT(sent_nits(profile, next), held.ceiling().limit()) << target.transpose();
      }
      EXPECT_GT(compared, 500);
    }
  }
}

// The mean over dither of what is sent has the hue that is wanted, and is not far under the
// ceiling.
TEST(LuminanceCeiling, DitherStaysUnbiasedUnderIt) {
  const auto profile = profile_of(false);
  constexpr double kNits = 2.0;  // where a code is a large step
  const Compensation held(profile, {.luminance_ceiling = kNits});
  const Xyz target =
      profile.surface * (profile.primaries * Vector3d(0.9, 0.5, 0.3) + profile.ambient);
  Vector3d sum = Vector3d::Zero();
  Vector3d drive = Vector3d::Zero();
  constexpr std::uint32_t kSide = 128;
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x) {
      const auto pixel = held.pixel(target, 1.0, 1.0, kEven, x, y, 5);
      ASSERT_TRUE(pixel.held);
      sum += profile.linear_drive(pixel.codes);
      drive = pixel.drive;
    }
  // The lattice covers a patch far more evenly than chance does (dither.h).
  const Vector3d mean = sum / (kSide * kSide);
  EXPECT_LT((mean - drive).norm(), 0.002 * drive.norm()) << mean.transpose();
  EXPECT_GT(profile.emitted(mean).y() + profile.black.y(), 0.85 * kNits);
}

TEST(LuminanceCeiling, BelowBlackAllIsOff) {
  for (const bool with_residual : {false, true}) {
    const auto profile = profile_of(with_residual);
    for (const double nits : {1e-300, 0.5 * profile.black.y()}) {
      const Compensation held(profile, {.luminance_ceiling = nits});
      const auto pixel = held.pixel({50, 60, 40}, 1.0, 1.0, kEven, 1, 2, 3);
      EXPECT_EQ(pixel.codes, Codes{});
      EXPECT_TRUE(pixel.held);
      // What is off anyway was not brought down.
      EXPECT_FALSE(held.pixel({0, 0, 0}, 0.01, 1.0, kEven, 1, 2, 3).held);
    }
  }
}

TEST(LuminanceCeiling, AboveWhiteChangesNothing) {
  for (const bool with_residual : {false, true}) {
    const auto profile = profile_of(with_residual);
    const Compensation open(profile, {});
    const Compensation held(profile, {.luminance_ceiling = 1.001 * profile.white().y()});
    Pcg32 random(4);
    for (std::uint32_t i = 0; i < 2000; ++i) {
      const Xyz target = random_target(random);
      const auto pixel = held.pixel(target, 1.0, 1.0, kEven, i, i, i);
      ASSERT_FALSE(pixel.held);
      ASSERT_EQ(pixel.codes, open.pixel(target, 1.0, 1.0, kEven, i, i, i).codes);
    }
  }
}

TEST(LuminanceCeiling, OptionsThatAreNoneAreRefused) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const double nits : {-1e-9, -100.0, kNan, HUGE_VAL, -HUGE_VAL}) {
    const auto refused = PreparedProfile::prepare(profile_of(false), {.luminance_ceiling = nits});
    ASSERT_FALSE(refused) << nits;
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
    EXPECT_NE(refused.error().what.find("luminance_ceiling"), std::string::npos);
  }
}

class HeldRenderer : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
  }
  static Result<std::unique_ptr<Renderer>> make(const calibration::ProjectorProfile& profile,
                                                const RendererOptions& options) {
    Scene scene;
    scene.mesh = *load_mesh("sphere");
    scene.lights = {DirectionalLight{{0, 0, 1}, Vector3d::Constant(1000.0)}};
    return Renderer::create(scene,
                            one_level(ShaderMaterial("return vec3(0.9, 0.6, 0.4) * light.z;")),
                            profile,
                            options);
  }
};

TEST_F(HeldRenderer, SendsNoMoreAndCountsWhatItHeld) {
  struct Case {
    bool with_residual;
    bool exchangeable;
    bool compensate;
  };
  for (const auto& [with_residual, exchangeable, compensate] :
       {Case{false, false, true}, Case{true, true, true}, Case{true, false, false}}) {
    const auto profile = profile_of(with_residual);
    constexpr double kNits = 50;
    auto renderer =
        make(profile,
             {.compensate = compensate, .exchangeable = exchangeable, .luminance_ceiling = kNits});
    ASSERT_TRUE(renderer) << renderer.error().what;
    for (std::uint32_t seed = 0; seed < 3; ++seed) {
      (*renderer)->draw({{0, 0, 1}, {}, seed});
      Image<Rgb16> codes(64, 48);
      (*renderer)->read_codes(codes.view());
      double most = 0;
      for (const Rgb16& pixel : codes.pixels()) most = std::max(most, sent_nits(profile, pixel));
      EXPECT_LE(most, kNits);
      EXPECT_GT(most, 0.9 * kNits);
    }
    (*renderer)->finish();
    const FrameStatistics statistics = (*renderer)->statistics();
    EXPECT_GT(statistics.held_pixels, 50U);
    EXPECT_LT(statistics.held_pixels, statistics.covered_pixels);
  }
}

TEST_F(HeldRenderer, NoProfileLiftsIt) {
  const RendererOptions options{.luminance_ceiling = 50};
  auto renderer = make(profile_of(false), options);
  ASSERT_TRUE(renderer) << renderer.error().what;
  for (const double nits : {0.0, 49.0, 51.0}) {
    const auto other = PreparedProfile::prepare(profile_of(true), {.luminance_ceiling = nits});
    const Status refused = (*renderer)->set_profile(other.value());
    ASSERT_FALSE(refused) << nits;
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
    EXPECT_NE(refused.error().what.find("50"), std::string::npos) << refused.error().what;
  }
  EXPECT_TRUE(
      (*renderer)->set_profile(PreparedProfile::prepare(profile_of(true), options).value()));
}

TEST_F(HeldRenderer, RefusesACeilingThatIsNone) {
  const auto refused =
      make(profile_of(false), {.luminance_ceiling = std::numeric_limits<double>::quiet_NaN()});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
}

}  // namespace
}  // namespace veneer::render
