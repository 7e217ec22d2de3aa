// SPDX-License-Identifier: Apache-2.0
#include "calibration/profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>

#include "base/files.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

/// Numbers without a short decimal form, so that a round trip that rounds is noticed.
ProjectorProfile example_profile() {
  ProjectorProfile p;
  p.geometry = {64, 48, 100.0 / 3.0, 33.4, 31.0 + 1.0 / 7.0, 24.1, {}};
  p.geometry.world_from_projector =
      look_at({0.25, 0.35, 1.15}, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitY());
  p.bits = 4;
  for (std::size_t c = 0; c < 3; ++c)
    for (int code = 0; code < 16; ++code)
      p.tone_curves[c].push_back(std::pow(code / 15.0, 2.0 + 0.1 * static_cast<double>(c)));
  p.primaries << 330.0 / 7, 250.0 / 7, 140.0 / 7, 160.0 / 7, 500.0 / 7, 60.0 / 7, 10.0 / 7,
      70.0 / 7, 760.0 / 7;
  p.black = {0.1 / 3, 0.1 / 3, 0.1 / 3};
  p.reference_distance_m = 1.2;
  p.vignetting = Image<float>(3, 2, 0.9F);
  p.vignetting(1, 1) = 1.0F / 3.0F;
  p.surface << 0.8, 0.01 / 3, 0, 0.001, 0.75, 0, 0, 0, 0.6;
  p.ambient = {1.9, 2.0, 2.1};
  return p;
}

class ProfileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              fmt::format("veneer_profile_{}_{}", ::getpid(), test->name());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// Rewrites profile.json of a saved profile.
  void edit_json(const std::function<void(nlohmann::json&)>& edit) const {
    const auto text = read_text(folder_ / "profile.json");
    ASSERT_TRUE(text);
    nlohmann::json json = nlohmann::json::parse(*text);
    edit(json);
    ASSERT_TRUE(write_text(folder_ / "profile.json", json.dump()));
  }
  void expect_refused(std::string_view reason, Errc code = Errc::kBadFormat) const {
    const auto loaded = ProjectorProfile::load(folder_);
    ASSERT_FALSE(loaded);
    EXPECT_EQ(loaded.error().code, code) << loaded.error().what;
    EXPECT_THAT(loaded.error().what, HasSubstr(std::string(reason)));
    EXPECT_THAT(loaded.error().what, HasSubstr(folder_.string()));
  }

  std::filesystem::path folder_;
};

TEST_F(ProfileTest, ComesBackBitForBit) {
  const ProjectorProfile saved = example_profile();
  ASSERT_TRUE(saved.save(folder_));
  const auto loaded = ProjectorProfile::load(folder_);
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_EQ(loaded->geometry.width, saved.geometry.width);
  EXPECT_EQ(loaded->geometry.height, saved.geometry.height);
  EXPECT_EQ(loaded->geometry.fx, saved.geometry.fx);
  EXPECT_EQ(loaded->geometry.fy, saved.geometry.fy);
  EXPECT_EQ(loaded->geometry.cx, saved.geometry.cx);
  EXPECT_EQ(loaded->geometry.cy, saved.geometry.cy);
  EXPECT_EQ(loaded->geometry.world_from_projector.rotation.coeffs(),
            saved.geometry.world_from_projector.rotation.coeffs());
  EXPECT_EQ(loaded->geometry.world_from_projector.translation,
            saved.geometry.world_from_projector.translation);
  EXPECT_EQ(loaded->bits, saved.bits);
  EXPECT_EQ(loaded->tone_curves, saved.tone_curves);
  EXPECT_EQ(loaded->primaries, saved.primaries);
  EXPECT_EQ(loaded->black, saved.black);
  EXPECT_EQ(loaded->reference_distance_m, saved.reference_distance_m);
  EXPECT_EQ(loaded->surface, saved.surface);
  EXPECT_EQ(loaded->ambient, saved.ambient);
  ASSERT_EQ(loaded->vignetting.width(), 3);
  ASSERT_EQ(loaded->vignetting.height(), 2);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 3; ++x) EXPECT_EQ(loaded->vignetting(x, y), saved.vignetting(x, y));
}

TEST_F(ProfileTest, IsReplacedWhole) {
  ASSERT_TRUE(example_profile().save(folder_));
  ProjectorProfile newer = example_profile();
  newer.reference_distance_m = 2.0;
  ASSERT_TRUE(newer.save(folder_));
  EXPECT_EQ(ProjectorProfile::load(folder_)->reference_distance_m, 2.0);
}

TEST_F(ProfileTest, OneThatIsNotValidIsNotWritten) {
  ASSERT_TRUE(example_profile().save(folder_));
  ProjectorProfile bad = example_profile();
  bad.black.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(bad.save(folder_));
  EXPECT_TRUE(ProjectorProfile::load(folder_)) << "the last good one must stay";
}

TEST_F(ProfileTest, AMissingFolderIsNotFound) { expect_refused("profile.json", Errc::kNotFound); }

TEST_F(ProfileTest, AMissingMapIsNotFound) {
  ASSERT_TRUE(example_profile().save(folder_));
  std::filesystem::remove(folder_ / "vignetting.exr");
  expect_refused("vignetting.exr", Errc::kNotFound);
}

TEST_F(ProfileTest, ATruncatedManifestIsRefused) {
  ASSERT_TRUE(example_profile().save(folder_));
  std::filesystem::resize_file(folder_ / "profile.json", 200);
  expect_refused("no projector profile");
}

TEST_F(ProfileTest, AnotherFormatIsRefused) {
  ASSERT_TRUE(example_profile().save(folder_));
  edit_json([](nlohmann::json& json) { json["format"] = "something-else"; });
  expect_refused("no projector profile");
}

TEST_F(ProfileTest, ANewerVersionIsRefusedAsNewer) {
  ASSERT_TRUE(example_profile().save(folder_));
  edit_json([](nlohmann::json& json) {
    json["version"] = 2;
    json["profile"]["something_new"] =
        1;  // so the checksum differs too, but that is not the reason
  });
  expect_refused("newer");
}

TEST_F(ProfileTest, AChangedNumberIsRefused) {
  ASSERT_TRUE(example_profile().save(folder_));
  edit_json([](nlohmann::json& json) { json["profile"]["bits"] = 5; });
  expect_refused("checksum");
}

TEST_F(ProfileTest, AMissingKeyIsRefusedByName) {
  ASSERT_TRUE(example_profile().save(folder_));
  edit_json([](nlohmann::json& json) { json.erase("files"); });
  expect_refused("files");
}

TEST_F(ProfileTest, ADamagedMapIsRefused) {
  ASSERT_TRUE(example_profile().save(folder_));
  auto picture = read_text(folder_ / "vignetting.exr");
  ASSERT_TRUE(picture);
  picture->back() ^= 1;
  ASSERT_TRUE(write_text(folder_ / "vignetting.exr", *picture));
  expect_refused("vignetting.exr was changed or damaged");
}

struct Mistake {
  const char* reason;
  std::function<void(ProjectorProfile&)> make;
};

TEST(ProfileCheck, AcceptsTheExample) { EXPECT_TRUE(example_profile().check()); }

TEST(ProfileCheck, RefusesEveryMistake) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const std::vector<Mistake> mistakes{
      {"raster", [](ProjectorProfile& p) { p.geometry.width = 0; }},
      {"focal", [](ProjectorProfile& p) { p.geometry.fx = 0; }},
      {"focal", [](ProjectorProfile& p) { p.geometry.fy = kInf; }},
      {"principal", [](ProjectorProfile& p) { p.geometry.cx = kNan; }},
      {"pose", [](ProjectorProfile& p) { p.geometry.world_from_projector.translation.x() = kNan; }},
      {"pose", [](ProjectorProfile& p) { p.geometry.world_from_projector.rotation.w() += 1; }},
      {"bits", [](ProjectorProfile& p) { p.bits = 0; }},
      {"bits", [](ProjectorProfile& p) { p.bits = 17; }},
      {"15 values", [](ProjectorProfile& p) { p.tone_curves[1].pop_back(); }},
      {"green is not finite", [](ProjectorProfile& p) { p.tone_curves[1][3] = kNan; }},
      {"green falls", [](ProjectorProfile& p) { p.tone_curves[1][3] = 0.9; }},
      {"blue runs", [](ProjectorProfile& p) { p.tone_curves[2][0] = -0.1; }},
      {"red runs", [](ProjectorProfile& p) { p.tone_curves[0][15] = 0.99; }},
      {"primaries", [](ProjectorProfile& p) { p.primaries.col(1) = 2 * p.primaries.col(0); }},
      {"primaries", [](ProjectorProfile& p) { p.primaries(1, 1) = kNan; }},
      {"primaries", [](ProjectorProfile& p) { p.primaries.col(2).setZero(); }},
      {"surface", [](ProjectorProfile& p) { p.surface.setZero(); }},
      {"surface", [](ProjectorProfile& p) { p.surface(2, 2) = kInf; }},
      {"black", [](ProjectorProfile& p) { p.black.y() = -1; }},
      {"ambient", [](ProjectorProfile& p) { p.ambient.z() = kNan; }},
      {"distance", [](ProjectorProfile& p) { p.reference_distance_m = 0; }},
      {"distance", [](ProjectorProfile& p) { p.reference_distance_m = kNan; }},
      {"vignetting", [](ProjectorProfile& p) { p.vignetting = {}; }},
      {"vignetting", [](ProjectorProfile& p) { p.vignetting(0, 0) = 0; }},
      {"vignetting", [](ProjectorProfile& p) { p.vignetting(2, 1) = std::nanf(""); }},
  };
  for (std::size_t i = 0; i < mistakes.size(); ++i) {
    ProjectorProfile profile = example_profile();
    mistakes[i].make(profile);
    const Status status = profile.check();
    ASSERT_FALSE(status) << "mistake " << i << ": " << mistakes[i].reason;
    EXPECT_EQ(status.error().code, Errc::kBadFormat);
    EXPECT_THAT(status.error().what, HasSubstr(mistakes[i].reason)) << "mistake " << i;
  }
}

}  // namespace
}  // namespace veneer::calibration
