// SPDX-License-Identifier: Apache-2.0
// From a sample under polarised light to a sample set, in the virtual studio, held against its
// hidden truth.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include "base/progress.h"
#include "base/testing/temporary_folder.h"
#include "base/toml_reader.h"
#include "btf/direction.h"
#include "btf/sample_set.h"
#include "capture/development/developer.h"
#include "capture/development/sample_set.h"
#include "capture/session/session.h"
#include "simulation/studio/studio.h"

namespace veneer {
namespace {

using capture::CapturePlan;
using capture::DevelopedDirection;
using capture::Developer;
using capture::DevelopmentOptions;
using simulation::StudioTruth;
using simulation::VirtualStudio;

namespace fs = std::filesystem;

fs::path studios() { return fs::path(VENEER_ETC) / "studios"; }

/// The shipped plan with some of its lights; the mirror goes with the light nearest 10 degrees.
CapturePlan plan_with(const std::vector<double>& light_deg) {
  auto toml = TomlReader::open(studios() / "corrugated-rig.toml");
  EXPECT_TRUE(toml) << toml.error().what;
  CapturePlan plan = CapturePlan::read(*toml);
  toml->table("camera").ignore_the_rest();
  toml->table("polariser").ignore_the_rest();
  const Status finished = toml->finish();
  EXPECT_TRUE(finished) << finished.error().what;
  plan.lights.clear();
  plan.mirror_light = 0;
  for (const double degrees : light_deg) {
    const double theta = degrees * std::numbers::pi / 180;
    plan.lights.emplace_back(std::sin(theta), 0, std::cos(theta));
    if (std::abs(degrees - 10) <
        std::abs(std::asin(plan.lights[static_cast<std::size_t>(*plan.mirror_light)].x()) * 180 /
                     std::numbers::pi -
                 10))
      plan.mirror_light = static_cast<int>(plan.lights.size()) - 1;
  }
  plan.area.columns = 32;
  plan.area.rows = 32;
  plan.exposure.frames = 2;
  return plan;
}

/// A session in the studio and what it was developed to.
class Captured {
 public:
  Captured(const StudioTruth& truth, const CapturePlan& plan) {
    auto made = VirtualStudio::create(truth, plan, {}, progress_);
    EXPECT_TRUE(made) << made.error().what;
    studio = std::move(*made);
    const capture::CaptureDevices devices{
        &studio->camera(), studio->polariser(), &studio->hands(), &studio->clock()};
    auto outcome = capture::run_session(plan, folder(), devices, progress_);
    EXPECT_TRUE(outcome) << outcome.error().what;
    if (outcome) session = std::move(*outcome);
    auto opened = capture::Recording::open(folder());
    EXPECT_TRUE(opened) << opened.error().what;
    recording = std::make_unique<capture::Recording>(std::move(*opened));
  }

  [[nodiscard]] fs::path folder() const { return temporary_.path() / "session"; }
  [[nodiscard]] Developer developer(const DevelopmentOptions& options) {
    auto made = Developer::create(*recording, options, progress_);
    EXPECT_TRUE(made) << made.error().what;
    return std::move(*made);
  }

  std::unique_ptr<VirtualStudio> studio;
  capture::SessionOutcome session;
  std::unique_ptr<capture::Recording> recording;

 private:
  TemporaryFolder temporary_;
  SilentProgress progress_;
};

struct Rms {
  double specular = 0, diffuse = 0;
};

/// Over the unmasked texels and the channels.
Rms error_of(const DevelopedDirection& found, const VirtualStudio::TexelTruth& truth) {
  Rms squares;
  double samples = 0;
  for (std::size_t i = 0; i < found.masked.pixels().size(); ++i) {
    if (found.masked.pixels()[i] != 0) continue;
    squares.specular += (found.specular.pixels()[i] - truth.specular.pixels()[i]).squaredNorm();
    squares.diffuse += (found.diffuse.pixels()[i] - truth.diffuse.pixels()[i]).squaredNorm();
    samples += 3;
  }
  EXPECT_GT(samples, 0);
  return {std::sqrt(squares.specular / samples), std::sqrt(squares.diffuse / samples)};
}

StudioTruth shipped(const char* name) {
  auto truth = StudioTruth::load(studios() / name);
  EXPECT_TRUE(truth) << truth.error().what;
  truth->samples = 16;
  return *truth;
}

CapturePlan plan_for_mosaic() {
  CapturePlan plan = plan_with({10, 30});
  const auto truth = StudioTruth::load(studios() / "mosaic.toml");
  EXPECT_TRUE(truth) << truth.error().what;
  plan.lens = {
      Eigen::Vector2d::Constant(truth->focal_px), truth->principal_point, truth->k1, truth->k2};
  plan.exposure.most = 3;
  return plan;
}

TEST(Capture, FindsBothPartsToOnePercentThreeTimesBetterThanWithoutTheMirror) {
  Captured captured(shipped("corrugated.toml"), plan_with({-60, -40, -20, 0, 10, 30, 50}));
  const Developer corrected = captured.developer({});
  DevelopmentOptions without;
  without.correct_leak = false;
  const Developer uncorrected = captured.developer(without);
  Rms total;
  Rms total_uncorrected;
  const auto lights = static_cast<int>(corrected.plan().lights.size());
  for (int light = 0; light < lights; ++light) {
    const auto found = corrected.develop(0, light);
    ASSERT_TRUE(found) << found.error().what;
    const VirtualStudio::TexelTruth truth = captured.studio->truth(0, light);
    const Rms error = error_of(*found, truth);
    SCOPED_TRACE(
        fmt::format("light {}: specular {:.5f} (predicted {:.5f}), diffuse {:.5f} ({:.5f})",
                    light,
                    error.specular,
                    found->findings.predicted.specular,
                    error.diffuse,
                    found->findings.predicted.diffuse));
    EXPECT_LE(found->findings.fresnel.incidence_rad, 30.01 * std::numbers::pi / 180);
    EXPECT_LE(error.specular, 0.01);
    EXPECT_LE(error.diffuse, 0.01);
    const auto rough = uncorrected.develop(0, light);
    ASSERT_TRUE(rough) << rough.error().what;
    const Rms worse = error_of(*rough, truth);
    total.specular += error.specular * error.specular;
    total.diffuse += error.diffuse * error.diffuse;
    total_uncorrected.specular += worse.specular * worse.specular;
    total_uncorrected.diffuse += worse.diffuse * worse.diffuse;
  }
  EXPECT_GE(std::sqrt(total_uncorrected.specular / total.specular), 3);
  EXPECT_GE(std::sqrt(total_uncorrected.diffuse / total.diffuse), 3);
  EXPECT_TRUE(corrected.findings().noise_was_measured);
  EXPECT_TRUE(corrected.findings().leak_was_measured);
}

TEST(Capture, BeyondThoseAnglesTheErrorStaysWithinWhatIsPredicted) {
  CapturePlan plan = plan_with({10});
  for (const auto& [theta_deg, phi_deg] :
       {std::pair{45.0, 45.0}, {60.0, 45.0}, {75.0, 30.0}, {60.0, 90.0}, {78.0, 60.0}})
    plan.lights.push_back(btf::direction_from_angles(
        {theta_deg * std::numbers::pi / 180, phi_deg * std::numbers::pi / 180}));
  Captured captured(shipped("corrugated.toml"), plan);
  const Developer developer = captured.developer({});
  double most_leaked = 0;
  for (int light = 1; light < static_cast<int>(plan.lights.size()); ++light) {
    const auto found = developer.develop(0, light);
    ASSERT_TRUE(found) << found.error().what;
    const Rms error = error_of(*found, captured.studio->truth(0, light));
    SCOPED_TRACE(fmt::format("light {}", light));
    EXPECT_LE(error.specular, found->findings.predicted.specular);
    EXPECT_LE(error.diffuse, found->findings.predicted.diffuse);
    most_leaked = std::max(most_leaked, found->findings.fresnel.cross_fraction);
  }
  EXPECT_GT(most_leaked, 0.02);  // else nothing was asked of the prediction
}

TEST(Capture, AMosaicOnTheSensorFindsTheSameWithNothingThatTurns) {
  Captured captured(shipped("mosaic.toml"), plan_for_mosaic());
  const Developer developer = captured.developer({});
  const auto found = developer.develop(0, 1);
  ASSERT_TRUE(found) << found.error().what;
  // The sensor has no colours: it sees luminance.
  VirtualStudio::TexelTruth truth = captured.studio->truth(0, 1);
  const Rgb32f luminance(0.2126F, 0.7152F, 0.0722F);
  for (Image<Rgb32f>* part : {&truth.specular, &truth.diffuse}) {
    for (Rgb32f& texel : part->pixels()) texel = Rgb32f::Constant(luminance.dot(texel));
  }
  const Rms error = error_of(*found, truth);
  EXPECT_LE(error.specular, 0.01);
  EXPECT_LE(error.diffuse, 0.01);
  EXPECT_GT(found->findings.degree_of_polarisation, 0);
}

TEST(Capture, ASetIsWrittenWholeWithWhatWasDevelopedInIt) {
  Captured captured(shipped("corrugated.toml"), plan_with({0, 10, 40}));
  const Developer developer = captured.developer({});
  const TemporaryFolder folder;
  SilentProgress progress;
  std::vector<DevelopedDirection> directions;
  const auto written = capture::write_sample_set(
      developer,
      folder.path() / "sheet.btfset",
      {},
      [&directions](const DevelopedDirection& direction) -> Status {
        directions.push_back(direction);
        return {};
      },
      progress);
  ASSERT_TRUE(written) << written.error().what;
  EXPECT_EQ(written->masked_fraction, 0);
  const auto set = btf::SampleSet::open(folder.path() / "sheet.btfset");
  ASSERT_TRUE(set) << set.error().what;
  ASSERT_EQ(set->info().lights.size(), 3U);
  ASSERT_TRUE(set->info().polarised);
  std::vector<float> rgb(static_cast<std::size_t>(set->info().pair_count()) * 3);
  for (const int texel : {0, 500, 32 * 32 - 1}) {
    set->rgb(texel, btf::Part::kSpecular, rgb);
    for (std::size_t i = 0; i < rgb.size(); ++i) {
      const float expected =
          std::max(0.0F,
                   directions[i / 3].specular.pixels()[static_cast<std::size_t>(texel)]
                                                      [static_cast<Eigen::Index>(i % 3)]);
      EXPECT_NEAR(rgb[i], expected, 1e-3 * expected + 1e-6);  // half precision
    }
  }
}

}  // namespace
}  // namespace veneer
