// SPDX-License-Identifier: Apache-2.0
#include "render/compensate_pass.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "render/egl_context.h"
#include "render/internal_testing.h"

namespace veneer::render {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector4f;

constexpr int kWidth = 200;
constexpr int kHeight = 144;  // no multiples of count.comp's groups

// Targets of every kind, with geometry in w: mostly reachable ones, many out of gamut, and all that
// can go wrong.
std::vector<Vector4f> targets(const calibration::ProjectorProfile& profile) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  constexpr float kOdd[] = {kNan, kInf, -kInf, 0.0F, -0.0F, -3.0F, 65504.0F, 1e-7F};
  Pcg32 random(11);
  std::vector<Vector4f> all;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const double g = 0.02 + 1.5 * random.uniform();
    const double spread = i % 3 == 0 ? 4.0 : 1.0;
    const double shift = i % 3 == 0 ? 1.0 : 0.0;
    const Vector3d t(spread * random.uniform() - shift,
                     spread * random.uniform() - shift,
                     spread * random.uniform() - shift);
    const Vector3d s = profile.reflectance_at({i % kWidth + 0.5, i / kWidth + 0.5});
    const Matrix3d surface =
        profile.surface * profile.primaries * s.asDiagonal() * profile.primaries.inverse();
    const Vector3d sent = profile.primaries * (t + profile.residual(t)) + profile.black;
    const Vector3d xyz = surface * (g * sent + profile.ambient);
    Vector4f texel;
    texel << xyz.cast<float>(), static_cast<float>(g);
    if (i % 17 == 0) texel[static_cast<int>(random.next() % 4)] = kOdd[random.next() % 8];
    if (i % 23 == 0) texel[3] = 0;
    all.push_back(texel);
  }
  return all;
}

class CompensatePassTest : public ::testing::TestWithParam<RendererOptions> {};

// How far a drive computed in float may be off: the solution subtracts ambient light and black that
// are up to 1/G_floor = 20 times as large as full drive, each with a few roundings of 2^-24.
constexpr double kDriveTolerance = 2e-5;
// The same for a mapped one: the pow() of GL is less exact (llvmpipe: about 1e-5 relative), and one
// step of the bisection may go the other way.
constexpr double kMappedTolerance = 2e-3;
// Loss is stored in steps of 1/32, and pow() errs as above; absurd targets (a component of 65504)
// are left out, for which it is large.
constexpr double kLossTolerance = 0.1;

// Held under the ceiling, a drive that differs by the above may stop below another level of any
// channel, and the others follow it by their share: at the ceilings here a level is a seventh at
// most. So do few.
constexpr double kLevelOfHeld = 0.15;
constexpr double kHeldOtherwise = 0.002;  // of the codes

TEST_P(CompensatePassTest, AgreesWithTheCpu) {
  struct Case {
    int bits;
    bool patterned;
    bool residual;
  };
  for (const auto& [bits, patterned, with_residual] : {Case{8, false, false},
                                                       Case{10, false, false},
                                                       Case{8, true, false},
                                                       Case{10, true, false},
                                                       Case{8, false, true},
                                                       Case{10, true, true}}) {
    SCOPED_TRACE(
        fmt::format("{} bits, patterned: {}, residual: {}", bits, patterned, with_residual));
    auto profile = example_profile(kWidth, kHeight, bits);
    if (patterned) profile.surface_map = example_surface_map();
    if (with_residual) profile.residual = example_residual();
    auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
    const auto prepared = PreparedProfile::prepare(profile, GetParam());
    ASSERT_TRUE(prepared) << prepared.error().what;
    const Compensation& cpu = prepared->compensation();
    const Image<float>& vignetting = prepared->vignetting();
    const Image<Rgb32f>& reflectance = prepared->reflectance();
    auto pass = CompensatePass::create(*prepared);
    ASSERT_TRUE(pass) << pass.error().what;

    const std::vector<Vector4f> all = targets(profile);
    const GlTexture texture = make_texture_2d(GL_RGBA32F, kWidth, kHeight);
    glTextureSubImage2D(texture.id(), 0, 0, 0, kWidth, kHeight, GL_RGBA, GL_FLOAT, all.data());
    constexpr std::uint32_t kSeed = 77;
    pass->run(texture.id(), kSeed);
    std::vector<std::array<std::uint16_t, 4>> codes(all.size());
    glBindFramebuffer(GL_READ_FRAMEBUFFER, pass->framebuffer());
    glReadPixels(0, 0, kWidth, kHeight, GL_RGBA_INTEGER, GL_UNSIGNED_SHORT, codes.data());
    glFinish();

    CompensatePass::Counts counted;
    int borderline = 0;
    std::size_t held_alike = 0;
    std::size_t held_otherwise = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const auto x = static_cast<std::uint32_t>(i % kWidth);
      const auto y = static_cast<std::uint32_t>(i / kWidth);
      const Vector3d target = all[i].head<3>().cast<double>();
      const auto column = static_cast<int>(x);
      const auto row = static_cast<int>(y);
      const Vector3d s =
          patterned ? Vector3d(reflectance(column, row).cast<double>()) : Vector3d::Ones();
      const auto wanted = cpu.pixel(target, all[i][3], vignetting(column, row), s, x, y, kSeed);
      const auto state = static_cast<PixelState>(codes[i][3] >> 14U);
      const bool held = (codes[i][3] >> 13U & 1U) != 0;
      counted.held += held ? 1 : 0;
      if (cpu.ceiling().active()) {
        const std::array<std::uint16_t, 3> sent{codes[i][0], codes[i][1], codes[i][2]};
        ASSERT_LE(cpu.ceiling().luminance(sent), cpu.ceiling().nits())
            << all[i].transpose() << " at " << i;
      }
      const double loss = (codes[i][3] & 0x1fffU) / 32.0;
      counted.covered += state != PixelState::kNotCovered ? 1 : 0;
      counted.out_of_gamut += state == PixelState::kOutOfGamut ? 1 : 0;
      counted.out_of_reach += state == PixelState::kOutOfReach ? 1 : 0;
      counted.gamut_loss += loss;
      if (state != wanted.state) {  // within rounding of the floor or of the gamut's tolerance
        ++borderline;
        continue;
      }
      const bool mapped = state == PixelState::kOutOfGamut;
      // The best reflected primary's part of the target is rounded, and the least one's is seen.
      const double amplified = s.maxCoeff() / s.minCoeff();
      const double allowed = amplified * (mapped ? kMappedTolerance : kDriveTolerance);
      if (wanted.gamut_loss < 100) {
        ASSERT_NEAR(loss, wanted.gamut_loss, kLossTolerance) << all[i].transpose();
      }
      if (held != wanted.held) {  // within rounding of a code that is just allowed
        ++borderline;
        continue;
      }
      for (std::size_t c = 0; c < 3; ++c) {
        // The code that the CPU takes, or one that it would take for a drive within the tolerance.
        const double t = wanted.drive[static_cast<int>(c)];
        const auto& tone = cpu.tone_levels()[c];
        const double width = allowed + (held ? kLevelOfHeld * t : 0.0);
        const auto least = tone.bracket(std::max(t - width, 0.0)).lower;
        const auto most = tone.bracket(std::min(t + width, 1.0)).upper;
        ASSERT_GE(codes[i][c], std::min(least, wanted.codes[c]))
            << all[i].transpose() << " at " << i;
        ASSERT_LE(codes[i][c], std::max(most, wanted.codes[c]))
            << all[i].transpose() << " at " << i;
        if (held)
          ++(codes[i][c] == wanted.codes[c] ? held_alike : held_otherwise);
        else if (state == PixelState::kInGamut && codes[i][c] != wanted.codes[c])
          ++borderline;
      }
    }
    EXPECT_LT(borderline, 0.005 * all.size());
    EXPECT_LE(held_otherwise, kHeldOtherwise * (held_alike + held_otherwise));
    EXPECT_EQ(counted.held > all.size() / 20, cpu.ceiling().active());

    const CompensatePass::Counts& counts = pass->counts();
    EXPECT_EQ(counts.covered, counted.covered);
    EXPECT_EQ(counts.out_of_gamut, counted.out_of_gamut);
    EXPECT_EQ(counts.out_of_reach, counted.out_of_reach);
    EXPECT_EQ(counts.held, counted.held);
    EXPECT_DOUBLE_EQ(counts.gamut_loss, counted.gamut_loss);
    EXPECT_GT(counts.out_of_gamut, all.size() / 20);
    EXPECT_GT(counts.out_of_reach, all.size() / 200);
  }
}

INSTANTIATE_TEST_SUITE_P(Options,
                         CompensatePassTest,
                         ::testing::Values(RendererOptions{},
                                           RendererOptions{.dither = false},
                                           RendererOptions{.compensate = false},
                                           RendererOptions{.luminance_ceiling = 60},
                                           RendererOptions{.dither = false, .luminance_ceiling = 3},
                                           RendererOptions{.compensate = false,
                                                           .luminance_ceiling = 60}));

TEST(CompensatePass, NeverWaitsForCounts) {
  auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  const auto profile = example_profile(kWidth, kHeight, 8);
  auto pass = CompensatePass::create(PreparedProfile::prepare(profile, {}).value());
  ASSERT_TRUE(pass) << pass.error().what;
  EXPECT_EQ(pass->counts().covered, 0U);
  const GlTexture texture = make_texture_2d(GL_RGBA32F, kWidth, kHeight);
  for (int covered = 0; covered < 10; ++covered) {  // more frames than the ring is long
    std::vector<Vector4f> all(kWidth * kHeight, Vector4f::Zero());
    for (int i = 0; i <= covered; ++i)
      all[static_cast<std::size_t>(i * 501)] = Vector4f(5, 5, 5, 1);
    glTextureSubImage2D(texture.id(), 0, 0, 0, kWidth, kHeight, GL_RGBA, GL_FLOAT, all.data());
    pass->run(texture.id(), 0);
  }
  glFinish();
  EXPECT_EQ(pass->counts().covered, 10U);
}

}  // namespace
}  // namespace veneer::render
