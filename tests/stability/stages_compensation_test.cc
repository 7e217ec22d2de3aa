// SPDX-License-Identifier: Apache-2.0
// Compensation in double precision and the profile's own check, at the ends of what they may be
// given. Every case runs with invalid operations and divisions by zero trapped.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/testing/fp_trap.h"
#include "render/compensation.h"
#include "render/internal_testing.h"
#include "tests/stability/compensation_subjects.h"

namespace veneer::render {
namespace {

using calibration::ProjectorProfile;
using Subject = stability::CompensationSubject;
using Eigen::Vector3d;

struct Input {
  const char* name;
  double target;  ///< times D65
  double geometry;
  double vignetting;
  double reflectance;
};
const Input kInputs[] = {
    {"Usual", 20, 1, 1, 1},
    {"NoLight", 0, 1, 1, 1},
    {"DenormalTarget", 1e-310, 1, 1, 1},
    {"TargetOver1e7Lux", 3.2e6, 1, 1, 1},
    {"TargetAtHalfFloatsEnd", 65504, 1, 1, 1},
    {"TargetOf1e30", 1e30, 1, 1, 1},
    {"NegativeTarget", -5, 1, 1, 1},
    {"AtTheFloor", 1, 0.05, 1, 1},
    {"UnderTheFloor", 1, std::nextafter(0.05, 0.0), 1, 1},
    {"TinyG", 1, 1e-300, 1, 1},
    {"HugeG", 20, 1e12, 1, 1},
    {"NotCovered", 20, 0, 1, 1},
    {"FacingAway", 20, -1, 1, 1},
    {"NoVignetting", 20, 1, 0, 1},
    {"DarkestSurface", 20, 1, 1, 1e-6},
    {"BrightestSurface", 20, 1, 1, 1e6},
};

// The roundings of a solution, amplified by the condition of the worst M here (1e6).
constexpr double kSolveTolerance = 1e-8;

class CompensationAtExtremes : public testing::TestWithParam<std::tuple<Subject, Input>> {};

TEST_P(CompensationAtExtremes, AnswersInReachOrSaysThatItIsNot) {
  const auto& [subject, input] = GetParam();
  ProjectorProfile profile = example_profile(16, 12, subject.bits);
  RendererOptions options;
  subject.change(profile, options);
  ASSERT_TRUE(profile.check()) << profile.check().error().what;
  const FpTrap trap;
  const Compensation compensation(profile, options);
  const Xyz target = input.target * Vector3d(0.9505, 1, 1.089);
  const Vector3d s = Vector3d::Constant(input.reflectance);
  const auto pixel = compensation.pixel(target, input.geometry, input.vignetting, s, 3, 5, 7);

  ASSERT_TRUE(pixel.drive.allFinite()) << pixel.drive.transpose();
  EXPECT_GE(pixel.drive.minCoeff(), 0.0);
  EXPECT_LE(pixel.drive.maxCoeff(), 1.0);
  EXPECT_TRUE(std::isfinite(pixel.gamut_loss) && pixel.gamut_loss >= 0) << pixel.gamut_loss;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto codes_of_curve = compensation.tone_levels()[c].codes();
    EXPECT_TRUE(std::ranges::binary_search(codes_of_curve, pixel.codes[c])) << pixel.codes[c];
  }

  const double g = options.compensate ? input.geometry * input.vignetting : 1.0;
  if (input.geometry <= 0) {
    EXPECT_EQ(pixel.state, PixelState::kNotCovered);
  } else if (g < compensation.constants().geometry_floor) {
    EXPECT_EQ(pixel.state, PixelState::kOutOfReach);
  } else {
    EXPECT_TRUE(pixel.state == PixelState::kInGamut || pixel.state == PixelState::kOutOfGamut);
  }
  if (pixel.state == PixelState::kNotCovered || pixel.state == PixelState::kOutOfReach) {
    EXPECT_EQ(pixel.drive, Vector3d::Zero());
    EXPECT_EQ(pixel.codes, (std::array<std::uint16_t, 3>{}));
  }
  if (options.luminance_ceiling > 0 && pixel.codes != std::array<std::uint16_t, 3>{}) {
    EXPECT_TRUE(compensation.ceiling().allows(pixel.codes));
  }
  if (options.luminance_ceiling > 0 && !compensation.ceiling().allows({})) {
    EXPECT_EQ(pixel.codes, (std::array<std::uint16_t, 3>{}));  // black alone is over it
  }
  // What is said to be in gamut is what is sent, but for the tolerance that clamps.
  if (pixel.state == PixelState::kInGamut && options.compensate && !pixel.held &&
      profile.residual.empty() && pixel.drive.minCoeff() > 0 && pixel.drive.maxCoeff() < 1) {
    const Xyz shown = input.reflectance *
                      (profile.surface *
                       (g * (profile.primaries * pixel.drive + profile.black) + profile.ambient));
    // Not "less": the squares of denormals are 0.
    EXPECT_LE((shown - target).norm(), kSolveTolerance * target.norm());
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         CompensationAtExtremes,
                         testing::Combine(testing::ValuesIn(stability::compensation_subjects()),
                                          testing::ValuesIn(kInputs)),
                         [](const auto& at) {
                           std::string name = std::string(std::get<0>(at.param).name) + "_" +
                                              std::get<1>(at.param).name;
                           std::erase(name, '-');
                           return name;
                         });

class TargetThatIsNoNumber : public testing::TestWithParam<double> {};
TEST_P(TargetThatIsNoNumber, StaysBlack) {
  const Compensation compensation(example_profile(16, 12, 8), {});
  for (int i = 0; i < 3; ++i) {
    Xyz target(1, 1, 1);
    target[i] = GetParam();
    const auto pixel = compensation.pixel(target, 1, 1, Vector3d::Ones(), 0, 0, 0);
    EXPECT_EQ(pixel.state, PixelState::kOutOfReach);
    EXPECT_EQ(pixel.codes, (std::array<std::uint16_t, 3>{}));
  }
}
INSTANTIATE_TEST_SUITE_P(All, TargetThatIsNoNumber, testing::Values(NAN, HUGE_VAL, -HUGE_VAL));

struct Refused {
  const char* name;
  void (*change)(ProjectorProfile&);
};
class ProfileAtExtremes : public testing::TestWithParam<Refused> {};
TEST_P(ProfileAtExtremes, IsRefusedWithAText) {
  ProjectorProfile profile = example_profile(16, 12, 8);
  ASSERT_TRUE(profile.check());
  GetParam().change(profile);
  const FpPause pause;
  const Status status = profile.check();
  ASSERT_FALSE(status);
  EXPECT_FALSE(status.error().what.empty());
}
const Refused kRefused[] = {
    {"ZeroPrimaries", [](ProjectorProfile& p) { p.primaries.setZero(); }},
    {"EqualPrimaries", [](ProjectorProfile& p) { p.primaries.col(2) = p.primaries.col(0); }},
    {"PrimariesUnder1em6",
     [](ProjectorProfile& p) {
       p.primaries.col(2) = p.primaries.col(0) + 1e-7 * p.primaries.col(2);
     }},
    {"SingularSurface", [](ProjectorProfile& p) { p.surface.row(1) = p.surface.row(0); }},
    {"ZeroSurface", [](ProjectorProfile& p) { p.surface.setZero(); }},
    {"FallingCurve",
     [](ProjectorProfile& p) { std::swap(p.tone_curves[1][3], p.tone_curves[1][9]); }},
    {"FlatCurve", [](ProjectorProfile& p) { p.tone_curves[0].assign(256, 0.0); }},
    {"CurveThatIsNoNumber", [](ProjectorProfile& p) { p.tone_curves[2][7] = NAN; }},
    {"ShortCurve", [](ProjectorProfile& p) { p.tone_curves[2].pop_back(); }},
    {"NoBits", [](ProjectorProfile& p) { p.bits = 0; }},
    {"TooManyBits", [](ProjectorProfile& p) { p.bits = 40; }},
    {"NoRaster", [](ProjectorProfile& p) { p.geometry.width = 0; }},
    {"NoFocalLength", [](ProjectorProfile& p) { p.geometry.fx = 0; }},
    {"ZeroQuaternion",
     [](ProjectorProfile& p) { p.geometry.world_from_projector.rotation.coeffs().setZero(); }},
    {"NoReferenceDistance", [](ProjectorProfile& p) { p.reference_distance_m = 0; }},
    {"BlackThatIsNoNumber", [](ProjectorProfile& p) { p.black.y() = NAN; }},
    {"InfiniteAmbient", [](ProjectorProfile& p) { p.ambient.x() = HUGE_VAL; }},
    {"NoReflectance",
     [](ProjectorProfile& p) { p.surface_map = Image<Rgb32f>(1, 1, Rgb32f::Zero()); }},
};
INSTANTIATE_TEST_SUITE_P(All, ProfileAtExtremes, testing::ValuesIn(kRefused), [](const auto& at) {
  return std::string(at.param.name);
});

}  // namespace
}  // namespace veneer::render
