// SPDX-License-Identifier: Apache-2.0
// veneer capture stokes as a person and as a machine use it.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>

#include "base/image_files.h"
#include "tests/program.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

json parsed(const Outcome& outcome) {
  json object = json::parse(outcome.out, nullptr, false);
  EXPECT_TRUE(object.is_object()) << outcome.out << outcome.err;
  return object;
}

/// An even picture of S0 = 100 counts of 8 bits; one pixel is saturated.
Image<Rgb8> even_mosaic(double degree, double angle_rad) {
  Image<Rgb8> picture(64, 32);
  constexpr std::array<int, 4> kDegrees{90, 45, 135, 0};
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      const double analyser =
          kDegrees[static_cast<std::size_t>(2 * (y % 2) + x % 2)] * std::numbers::pi / 180;
      const double reading = 50 * (1 + degree * std::cos(2 * (angle_rad - analyser)));
      picture(x, y).fill(static_cast<std::uint8_t>(std::lround(reading)));
    }
  }
  picture(20, 10).fill(255);
  return picture;
}

void write(const std::string& path, const Image<Rgb8>& picture) {
  ASSERT_TRUE(write_png(path, picture.view()));
}

/// Counts are rounded by half of one, so S0, S1 and S2 are off by one at most, of 100: the degree
/// by (sqrt(2) + 0.5) / 99.
constexpr double kRounding = 0.0194;

TEST(CaptureStokes, TellsHowALightIsPolarised) {
  const TemporaryFolder folder;
  const std::string image = (folder.path() / "even.png").string();
  write(image, even_mosaic(0.5, std::numbers::pi / 6));
  for (const std::string layout : {"polarsens-mono", "polarsens-colour"}) {
    const int cell = layout == "polarsens-mono" ? 2 : 4;
    const fs::path output = folder.path() / layout;
    const Outcome outcome = run("veneer capture stokes " + image + " --json --layout " + layout +
                                " -o " + output.string());
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const json found = parsed(outcome);
    const int cells = 64 * 32 / cell / cell;
    EXPECT_EQ(found["width"], 64 / cell);
    EXPECT_EQ(found["height"], 32 / cell);
    EXPECT_EQ(found["cells_used"], cells - 1);
    EXPECT_DOUBLE_EQ(found["saturated_fraction"], 1.0 / cells);
    for (const char* figure : {"dolp_p50", "dolp_p95", "dolp_p999"})
      EXPECT_NEAR(found[figure], 0.5, kRounding) << figure;
    EXPECT_NEAR(found["residual_median"], 0, 0.02);
    // The field at 30 degrees is yellow, a third of the wheel.
    const auto angle = read_png(output / "aolp.png");
    ASSERT_TRUE(angle) << angle.error().what;
    EXPECT_GT((*angle)(0, 0)[0], 240);
    EXPECT_GT((*angle)(0, 0)[1], 240);
    EXPECT_LT((*angle)(0, 0)[2], 10);
    const auto exr = read_exr(output / "stokes.exr");
    ASSERT_TRUE(exr) << exr.error().what;
    EXPECT_EQ(exr->size(), cell == 2 ? 4U : 10U);
    for (const char* name : {"s0.png", "dolp.png", "aolp_wheel.png", "saturated.png"})
      EXPECT_TRUE(fs::exists(output / name)) << name;
  }
  const json full =
      parsed(run("veneer capture stokes " + image + " --json --demosaic --layout polarsens-mono"));
  EXPECT_EQ(full["width"], 64);
  EXPECT_NEAR(full["dolp_p95"], 0.5, kRounding);
}

TEST(CaptureStokes, RefusesWhatItCannotUse) {
  const TemporaryFolder folder;
  const std::string image = (folder.path() / "even.png").string();
  const std::string colour = (folder.path() / "colour.png").string();
  const std::string odd = (folder.path() / "odd.png").string();
  write(image, even_mosaic(0, 0));
  write(colour, Image<Rgb8>(4, 4, Rgb8{1, 2, 3}));
  write(odd, Image<Rgb8>(5, 4));
  const std::string mono = " --layout polarsens-mono ";
  EXPECT_TRUE(fails(run("veneer capture"), 2, "--rig"));
  EXPECT_TRUE(fails(run("veneer capture stokes " + image), 2, "--layout"));
  EXPECT_TRUE(
      fails(run("veneer capture stokes " + image + " --layout bayer"), 2, "polarsens-mono"));
  EXPECT_TRUE(fails(run("veneer capture stokes nowhere.png" + mono), 1, "nowhere.png"));
  EXPECT_TRUE(fails(run("veneer capture stokes " + colour + mono), 1, "no raw mosaic"));
  EXPECT_TRUE(fails(run("veneer capture stokes " + odd + mono), 1, "5 x 4"));
  EXPECT_TRUE(fails(run("veneer capture stokes " + image + mono + "--extinction 1"), 2, "above 1"));
  EXPECT_TRUE(
      fails(run("veneer capture stokes " + image + mono + "--full-scale 0"), 2, "full-scale"));
}

// Real mosaics (../shared/data/polarsens/ORIGIN.txt): the figures that are asked for.
TEST(CaptureStokes, GivesTheFiguresOfRealMosaics) {
  const char* data = std::getenv("VENEER_DATA");
  const fs::path folder = fs::absolute(fs::path(data == nullptr ? "" : data) / "polarsens");
  if (!fs::exists(folder)) GTEST_SKIP() << "real data absent: " << folder;
  const json found =
      parsed(run("veneer capture stokes " + (folder / "fruits_IMX250MZR.png").string() +
                 " --layout polarsens-mono --json"));
  EXPECT_EQ(found["width"], 1224);
  EXPECT_EQ(found["height"], 1024);
  EXPECT_NEAR(found["dolp_p50"], .079, .0005);
  EXPECT_NEAR(found["dolp_p95"], .253, .0005);
  EXPECT_NEAR(found["dolp_p999"], .477, .0005);
  EXPECT_NEAR(found["residual_median"], -.0206, .00005);
}

}  // namespace
}  // namespace veneer
