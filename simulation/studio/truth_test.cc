// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "base/files.h"
#include "simulation/studio/testing.h"

namespace veneer::simulation {
namespace {

using ::testing::HasSubstr;

Result<StudioTruth> load_text(std::string_view text) {
  const auto path = std::filesystem::temp_directory_path() /
                    fmt::format("veneer_studio_truth_{}.toml", ::getpid());
  if (const Status written = write_text(path, text); !written)
    return tl::unexpected(written.error());
  auto truth = StudioTruth::load(path);
  std::filesystem::remove(path);
  return truth;
}

TEST(StudioTruth, EveryStudioLoads) {
  for (const char* name : {"corrugated", "perfect", "mosaic"}) {
    const auto truth =
        StudioTruth::load(std::filesystem::path(VENEER_ETC) / fmt::format("studios/{}.toml", name));
    ASSERT_TRUE(truth) << truth.error().what;
  }
}

TEST(StudioTruth, TheIssuesStudioIsWhatItIsToBe) {
  const auto truth = StudioTruth::load(VENEER_ETC "/studios/corrugated.toml");
  ASSERT_TRUE(truth) << truth.error().what;
  EXPECT_EQ(truth->material, "corrugated");
  EXPECT_EQ(truth->light_extinction, 100);
  EXPECT_EQ(truth->analyser_extinction, 100);
  EXPECT_EQ(truth->misalignment_deg, 3);
  EXPECT_EQ(truth->bits, 12);
  EXPECT_GT(truth->read_noise, 0);
  EXPECT_LE(truth->full_well, 1e5);
  const auto perfect = StudioTruth::load(VENEER_ETC "/studios/perfect.toml");
  ASSERT_TRUE(perfect);
  EXPECT_GE(perfect->light_extinction, 1e12);
  EXPECT_GE(perfect->analyser_extinction, 1e12);
}

TEST(StudioTruth, ThePictureIsCentredWhereNothingElseIsSaid) {
  const auto truth = load_text("width = 100\nheight = 50\n");
  ASSERT_TRUE(truth) << truth.error().what;
  EXPECT_EQ(truth->principal_point, Eigen::Vector2d(50, 25));
}

TEST(StudioTruth, MistakesInTheFileAreNamed) {
  const auto expect_refused = [](std::string_view text, const char* reason) {
    const auto truth = load_text(text);
    ASSERT_FALSE(truth) << text;
    EXPECT_EQ(truth.error().code, Errc::kInvalidOption);
    EXPECT_THAT(truth.error().what, HasSubstr(reason));
  };
  expect_refused("bit = 12", "bits");
  expect_refused("bits = 12.5", "bits");
  expect_refused("bits = 17", "bits is 17");
  expect_refused("material = \"marble\"", "marble");
  expect_refused("focal_px = 400\nk1 = -9.0", "folds over");
}

TEST(StudioTruth, AMissingFileIsNotFound) {
  const auto truth = StudioTruth::load("no/such/studio.toml");
  ASSERT_FALSE(truth);
  EXPECT_EQ(truth.error().code, Errc::kNotFound);
}

TEST(StudioTruth, EveryRangeIsChecked) {
  ASSERT_TRUE(StudioTruth{}.check());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::function<void(StudioTruth&)>> mistakes{
      [](StudioTruth& t) { t.tile_mm = -1; },
      [](StudioTruth& t) { t.tile_mm = kNan; },
      [](StudioTruth& t) { t.samples = 0; },
      [](StudioTruth& t) { t.index = 1; },
      [](StudioTruth& t) { t.light_extinction = 0.9; },
      [](StudioTruth& t) { t.analyser_extinction = kNan; },
      [](StudioTruth& t) { t.misalignment_deg = 91; },
      [](StudioTruth& t) { t.polarised_gain = 0; },
      [](StudioTruth& t) { t.irradiance = 0; },
      [](StudioTruth& t) { t.ambient = -0.1; },
      [](StudioTruth& t) { t.light_fall_off = 1; },
      [](StudioTruth& t) { t.light_aim_error_deg = -1; },
      [](StudioTruth& t) { t.width = 8; },
      [](StudioTruth& t) { t.height = 10000; },
      [](StudioTruth& t) { t.focal_px = 0; },
      [](StudioTruth& t) { t.principal_point.x() = -1; },
      [](StudioTruth& t) { t.principal_point.y() = kNan; },
      [](StudioTruth& t) { t.k1 = kNan; },
      [](StudioTruth& t) { t.k2 = -1e5; },
      [](StudioTruth& t) { t.distance_mm = 0; },
      [](StudioTruth& t) { t.full_well = 0; },
      [](StudioTruth& t) { t.read_noise = -1; },
      [](StudioTruth& t) { t.dark_current = -1; },
      [](StudioTruth& t) { t.fixed_pattern = 0.2; },
      [](StudioTruth& t) { t.offset_counts = 500; },
      [](StudioTruth& t) { t.vignetting = 1; },
      [](StudioTruth& t) { t.response_gamma = 0; },
      [](StudioTruth& t) { t.bits = 7; },
      [](StudioTruth& t) { t.dropped = 1; },
      [](StudioTruth& t) { t.dropped = t.repeated = 0.6; },
  };
  for (std::size_t i = 0; i < mistakes.size(); ++i) {
    StudioTruth truth;
    mistakes[i](truth);
    const Status status = truth.check();
    ASSERT_FALSE(status) << "mistake " << i;
    EXPECT_EQ(status.error().code, Errc::kInvalidOption);
  }
}

}  // namespace
}  // namespace veneer::simulation
