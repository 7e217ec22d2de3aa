// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "base/files.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using ::testing::HasSubstr;

std::filesystem::path demo_path() { return VENEER_ETC "/benches/demo.toml"; }

/// Loads the demo's bench with one piece of text replaced.
Result<BenchTruth> load_changed(std::string_view from, std::string_view to) {
  auto text = read_text(demo_path());
  if (!text) return tl::unexpected(text.error());
  const auto at = text->find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text->replace(at, from.size(), to);
  const auto path = std::filesystem::temp_directory_path() /
                    fmt::format("veneer_bench_truth_{}.toml", ::getpid());
  if (const Status written = write_text(path, *text); !written)
    return tl::unexpected(written.error());
  auto truth = BenchTruth::load(path);
  std::filesystem::remove(path);
  return truth;
}

TEST(BenchTruth, TheDemosBenchLoads) {
  const auto truth = BenchTruth::load(demo_path());
  ASSERT_TRUE(truth) << truth.error().what;
  EXPECT_EQ(truth->projector.width, 640);
  EXPECT_EQ(truth->projector.channels[1].tone, ChannelTruth::Tone::kSCurve);
  EXPECT_EQ(truth->projector.channels[2].centre_nm, 459.0);
  EXPECT_EQ(truth->object.mesh, "sphere");
  EXPECT_EQ(truth->instrument.relative_noise, 0.003);
  ASSERT_TRUE(truth->camera && truth->board);
  EXPECT_EQ(truth->camera->bits, 12);
  EXPECT_EQ(truth->board->columns, 9);
  EXPECT_NEAR(
      truth->board->board_from_sensor.rotation.angularDistance(Eigen::Quaterniond::Identity()),
      Eigen::Vector3d(8, -14, 75).norm() * std::numbers::pi / 180,
      1e-12);
  // The projector looks at the origin: that lies on its +z axis.
  const Eigen::Vector3d origin =
      truth->projector.world_from_projector.inverse() * Eigen::Vector3d::Zero();
  EXPECT_NEAR(origin.head<2>().norm(), 0, 1e-12);
  EXPECT_GT(origin.z(), 1);
}

TEST(BenchTruth, MistakesInTheFileAreNamed) {
  const auto expect_refused = [](std::string_view from, std::string_view to, const char* reason) {
    const auto truth = load_changed(from, to);
    ASSERT_FALSE(truth) << to;
    EXPECT_EQ(truth.error().code, Errc::kInvalidOption) << truth.error().what;
    EXPECT_THAT(truth.error().what, HasSubstr(reason));
  };
  expect_refused("blur_px", "blurr_px", "blur_px");
  expect_refused("white_nits = 800.0", "", "white_nits");
  expect_refused("white_nits = 800.0", "white_nits = -1.0", "projector.white_nits is -1");
  expect_refused("white_nits = 800.0", "white_nits = nan", "projector.white_nits");
  expect_refused("tone = \"power\"", "tone = \"gamma\"", "s-curve");
  expect_refused("exponent = 2.25", "", "exponent");
  expect_refused("target = [0.0, 0.0, 0.0]", "target = [0.25, 0.35, 1.15]", "target");
  expect_refused("0.85, 0.855]", "0.85]", "as many of each");
  expect_refused("[400, 450", "[450, 400", "does not rise");
  expect_refused("samples = 3", "samples = 0", "eye.samples");
  expect_refused("[instrument]", "[instrumnt]", "instrument");
  expect_refused("full_well = 10000.0", "full_wel = 10000.0", "full_well");
  expect_refused("focal_px = 3600.0", "", "focal_px");
  expect_refused("target = [0.0, 0.0, -0.02]", "target = [-0.30, 0.24, 1.22]", "target");
  expect_refused("k1 = -0.12 ", "k1 = -9.0 ", "folds over");
  expect_refused("poses = 10", "poses = 2", "board.poses");
}

TEST(BenchTruth, ACameraWithoutABoardIsRefused) {
  BenchTruth truth = testing::plain_truth();
  truth.camera = CameraTruth{};
  const Status status = truth.check();
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().what, HasSubstr("go together"));
  truth.board = BoardTruth{};
  EXPECT_TRUE(truth.check());
  truth.camera.reset();
  EXPECT_FALSE(truth.check());
}

TEST(BenchTruth, AMissingFileIsNotFound) {
  const auto truth = BenchTruth::load("no/such/bench.toml");
  ASSERT_FALSE(truth);
  EXPECT_EQ(truth.error().code, Errc::kNotFound);
}

TEST(BenchTruth, AnSCurveThatFallsIsRefused) {
  BenchTruth truth = testing::plain_truth();
  truth.projector.channels[1] = {ChannelTruth::Tone::kSCurve, 0, 2.0, 4.0, 0.5, 535, 20, 1};
  const Status status = truth.check();
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().what, HasSubstr("projector.green"));
}

TEST(BenchTruth, EveryRangeIsChecked) {
  const std::vector<std::function<void(BenchTruth&)>> mistakes{
      [](BenchTruth& t) { t.projector.width = 0; },
      [](BenchTruth& t) { t.projector.bits = 17; },
      [](BenchTruth& t) { t.projector.focal_px.y() = 0; },
      [](BenchTruth& t) { t.projector.leak = 0.4; },
      [](BenchTruth& t) { t.projector.interaction = -0.1; },
      [](BenchTruth& t) { t.projector.reference_distance_m = 0; },
      [](BenchTruth& t) { t.projector.chromaticity_drift = 0.31; },
      [](BenchTruth& t) { t.projector.white_segment = std::nan(""); },
      [](BenchTruth& t) { t.projector.white_segment_exponent = 0.5; },
      [](BenchTruth& t) { t.projector.white_segment_kelvin = 0; },
      [](BenchTruth& t) { t.projector.lamp_drift = -0.1; },
      [](BenchTruth& t) { t.projector.lamp_settling_s = 0; },
      [](BenchTruth& t) { t.instrument.relative_noise = -1; },
      [](BenchTruth& t) { t.instrument.dark_noise_nits = std::nan(""); },
      [](BenchTruth& t) { t.instrument.drift_per_hour = 1; },
      [](BenchTruth& t) { t.instrument.matrix_error(1, 2) = std::nan(""); },
      [](BenchTruth& t) { t.tracker.position_noise_m = -1; },
      [](BenchTruth& t) { t.tracker.rotation_noise_deg = 11; },
      [](BenchTruth& t) { t.camera->width = 0; },
      [](BenchTruth& t) { t.camera->focal_px = 0; },
      [](BenchTruth& t) { t.camera->principal_point.x() = -1; },
      [](BenchTruth& t) { t.camera->k1 = -9; },
      [](BenchTruth& t) { t.camera->k2 = std::nan(""); },
      [](BenchTruth& t) { t.camera->sensitivity = 0; },
      [](BenchTruth& t) { t.camera->full_well = 0; },
      [](BenchTruth& t) { t.camera->read_noise = -1; },
      [](BenchTruth& t) { t.camera->bits = 17; },
      [](BenchTruth& t) { t.camera->most_exposure_s = 1e-5; },
      [](BenchTruth& t) { t.camera->samples = 0; },
      [](BenchTruth& t) { t.board->columns = 1; },
      [](BenchTruth& t) { t.board->square_m = 0; },
      [](BenchTruth& t) { t.board->border_m = -1; },
      [](BenchTruth& t) { t.board->black = 0.9; },
      [](BenchTruth& t) { t.board->poses = 2; },
      [](BenchTruth& t) { t.board->tilt_deg = 61; },
      [](BenchTruth& t) { t.projector.black_fraction = std::nan(""); },
      [](BenchTruth& t) { t.projector.vignetting_drop = 1; },
      [](BenchTruth& t) { t.projector.vignetting_off_centre.x() = 1; },
      [](BenchTruth& t) { t.projector.blur_px = -1; },
      [](BenchTruth& t) { t.projector.channels[0].width_nm = 0; },
      [](BenchTruth& t) { t.projector.channels[2].exponent = 0; },
      [](BenchTruth& t) { t.object.reflectance = {1.1}; },
      [](BenchTruth& t) { t.object.wavelength_nm.clear(); },
      [](BenchTruth& t) { t.object.texture_reflectance = {0.5}; },
      [](BenchTruth& t) { t.object.texture = ObjectTruth::Texture::kChecks; },
      [](BenchTruth& t) { t.object.texture_fields = 0; },
      [](BenchTruth& t) { t.room.ambient_kelvin = 0; },
      [](BenchTruth& t) { t.eye.vertical_fov_deg = 180; },
  };
  EXPECT_TRUE(testing::plain_truth().check());
  for (std::size_t i = 0; i < mistakes.size(); ++i) {
    BenchTruth truth = testing::plain_truth();
    truth.camera = CameraTruth{};
    truth.board = BoardTruth{};
    EXPECT_TRUE(truth.check());
    mistakes[i](truth);
    EXPECT_FALSE(truth.check()) << "mistake " << i;
  }
}

TEST(ObjectTexture, AlternatesFromFieldToFieldAndIsNoneByDefault) {
  ObjectTruth object;
  EXPECT_FALSE(object.painted({0.3, 0.3}));
  object.texture_fields = 4;
  for (int y = -3; y < 4; ++y)
    for (int x = -3; x < 4; ++x) {
      const Eigen::Vector2d uv((x + 0.5) / 4, (y + 0.5) / 4);
      object.texture = ObjectTruth::Texture::kChecks;
      EXPECT_EQ(object.painted(uv), (x + y) % 2 != 0) << uv.transpose();
      object.texture = ObjectTruth::Texture::kStripes;
      EXPECT_EQ(object.painted(uv), x % 2 != 0) << uv.transpose();
    }
}

}  // namespace
}  // namespace veneer::simulation
