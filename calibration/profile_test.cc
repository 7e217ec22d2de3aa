// SPDX-License-Identifier: Apache-2.0
#include "calibration/profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>
#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <string>
#include <utility>

#include "base/files.h"
#include "base/image_files.h"
#include "base/random.h"

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

ProjectorProfile example_with_map() {
  ProjectorProfile p = example_profile();
  p.surface_map = Image<Rgb32f>(2, 3, Rgb32f(1.0F, 0.9F, 1.1F));
  p.surface_map(1, 2) = Rgb32f(1.0F / 3.0F, 0.02F, 2.5F);
  return p;
}

ProjectorProfile example_with_residual() {
  ProjectorProfile p = example_with_map();
  p.residual = ColourResidual::sampled(5, [](const Eigen::Vector3d& t) -> Eigen::Vector3d {
    return t.minCoeff() * Eigen::Vector3d(0.2, 0.25, 1.0 / 3) - 0.05 * t.x() * t;
  });
  p.colour_model = "white segment";
  p.record = {{"instrument", "a colorimeter, \u00b1 2 %"}, {"when", "2026-11-28T01:02:03Z"}};
  return p;
}

/// Without waiting for the disk, as write_text() does: for tests that write often.
void overwrite(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
}

std::string json_checksum(const nlohmann::json& json) {
  const std::string text = json.dump();
  const auto crc = crc32_z(0, reinterpret_cast<const Bytef*>(text.data()), text.size());
  return fmt::format("crc32:{:08x}", crc);
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

TEST_F(ProfileTest, TheSurfaceMapComesBackBitForBit) {
  const ProjectorProfile saved = example_with_map();
  ASSERT_TRUE(saved.save(folder_));
  const auto loaded = ProjectorProfile::load(folder_);
  ASSERT_TRUE(loaded) << loaded.error().what;
  ASSERT_EQ(loaded->surface_map.width(), 2);
  ASSERT_EQ(loaded->surface_map.height(), 3);
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 2; ++x) EXPECT_EQ(loaded->surface_map(x, y), saved.surface_map(x, y));
}

TEST_F(ProfileTest, AnEmptySurfaceMapStaysEmpty) {
  ASSERT_TRUE(example_with_map().save(folder_));
  ASSERT_TRUE(example_profile().save(folder_));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "surface_map.exr"));
  const auto loaded = ProjectorProfile::load(folder_);
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_TRUE(loaded->surface_map.empty());
}

TEST_F(ProfileTest, ADamagedSurfaceMapIsRefused) {
  ASSERT_TRUE(example_with_map().save(folder_));
  auto picture = read_text(folder_ / "surface_map.exr");
  ASSERT_TRUE(picture);
  picture->back() ^= 1;
  ASSERT_TRUE(write_text(folder_ / "surface_map.exr", *picture));
  expect_refused("surface_map.exr was changed or damaged");
}

TEST_F(ProfileTest, AMissingSurfaceMapIsNotFound) {
  ASSERT_TRUE(example_with_map().save(folder_));
  std::filesystem::remove(folder_ / "surface_map.exr");
  expect_refused("surface_map.exr", Errc::kNotFound);
}

TEST_F(ProfileTest, ASurfaceMapThatIsNoLongerListedIsRefused) {
  ASSERT_TRUE(example_with_map().save(folder_));
  edit_json([](nlohmann::json& json) { json["files"].erase("surface_map.exr"); });
  expect_refused("surface_map.exr");
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
    json["version"] = 4;
    json["profile"]["something_new"] =
        1;  // so the checksum differs too, but that is not the reason
  });
  expect_refused("newer");
}

TEST_F(ProfileTest, OneFromBeforeSurfacesHadMapsIsRead) {
  ASSERT_TRUE(example_profile().save(folder_));
  edit_json([](nlohmann::json& json) {
    json["version"] = 1;
    for (const char* key : {"has_surface_map", "has_colour_residual", "colour_model", "record"})
      json["profile"].erase(key);
    json["checksum"] = json_checksum(json["profile"]);
  });
  const auto loaded = ProjectorProfile::load(folder_);
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_TRUE(loaded->surface_map.empty());
}

TEST_F(ProfileTest, OneFromBeforeColourHadAResidualIsRead) {
  ASSERT_TRUE(example_with_map().save(folder_));
  edit_json([](nlohmann::json& json) {
    json["version"] = 2;
    for (const char* key : {"has_colour_residual", "colour_model", "record"})
      json["profile"].erase(key);
    json["checksum"] = json_checksum(json["profile"]);
  });
  const auto loaded = ProjectorProfile::load(folder_);
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_FALSE(loaded->surface_map.empty());
  EXPECT_TRUE(loaded->residual.empty());
  EXPECT_TRUE(loaded->colour_model.empty());
  EXPECT_TRUE(loaded->record.empty());
  const Eigen::Vector3d drive(0.2, 0.7, 0.4);
  EXPECT_EQ(loaded->emitted(drive), loaded->primaries * drive);
}

TEST_F(ProfileTest, TheColourModelComesBackInSinglePrecision) {
  const ProjectorProfile saved = example_with_residual();
  ASSERT_TRUE(saved.save(folder_));
  const auto loaded = ProjectorProfile::load(folder_);
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_EQ(loaded->colour_model, saved.colour_model);
  EXPECT_EQ(loaded->record, saved.record);
  ASSERT_EQ(loaded->residual.nodes(), 5);
  for (std::size_t i = 0; i < saved.residual.values().size(); ++i) {
    EXPECT_EQ(loaded->residual.values()[i].cast<float>(), saved.residual.values()[i].cast<float>());
  }
  // And once more without a loss.
  ASSERT_TRUE(loaded->save(folder_));
  EXPECT_EQ(ProjectorProfile::load(folder_)->residual.values(), loaded->residual.values());
}

TEST_F(ProfileTest, ADamagedColourResidualIsRefused) {
  ASSERT_TRUE(example_with_residual().save(folder_));
  auto picture = read_text(folder_ / "colour_residual.exr");
  ASSERT_TRUE(picture);
  picture->back() ^= 1;
  ASSERT_TRUE(write_text(folder_ / "colour_residual.exr", *picture));
  expect_refused("colour_residual.exr was changed or damaged");
}

TEST_F(ProfileTest, AColourResidualOfAnotherShapeIsRefused) {
  const auto replaced_by = [this](const Image<Rgb32f>& picture) {
    ASSERT_TRUE(example_with_residual().save(folder_));
    ASSERT_TRUE(write_exr(folder_ / "colour_residual.exr", picture.view()));
    const std::string bytes = read_text(folder_ / "colour_residual.exr").value();
    edit_json([&bytes](nlohmann::json& json) {
      const auto crc = crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
      json["files"]["colour_residual.exr"] = fmt::format("crc32:{:08x}", crc);
    });
  };
  replaced_by(Image<Rgb32f>(4, 15, Rgb32f::Zero()));
  expect_refused("4 x 15 pixels");
  replaced_by(Image<Rgb32f>(1, 1, Rgb32f::Zero()));
  expect_refused("1 x 1 pixels");
  replaced_by(Image<Rgb32f>(130, 130 * 130, Rgb32f::Zero()));
  expect_refused("130 x 16900 pixels");
  Image<Rgb32f> no_number(3, 9, Rgb32f::Zero());
  no_number(1, 7).y() = std::nanf("");
  replaced_by(no_number);
  expect_refused("not finite");
  replaced_by(Image<Rgb32f>(3, 9, Rgb32f::Zero()));
  EXPECT_TRUE(ProjectorProfile::load(folder_)) << "the shape is right";
}

TEST_F(ProfileTest, ExtraFilesAppearWithTheOthersOrNothingDoes) {
  const auto extra = [](const std::filesystem::path& folder) -> Status {
    EXPECT_TRUE(std::filesystem::exists(folder / "profile.json"));
    return write_text(folder / "projector.icc", "colour");
  };
  ASSERT_TRUE(example_profile().save(folder_, extra));
  EXPECT_EQ(read_text(folder_ / "projector.icc").value(), "colour");
  ProjectorProfile newer = example_profile();
  newer.reference_distance_m = 2.0;
  const Status failed = newer.save(folder_, [](const std::filesystem::path&) -> Status {
    return fail(Errc::kIo, "the disk is full");
  });
  ASSERT_FALSE(failed);
  EXPECT_THAT(failed.error().what, HasSubstr("the disk is full"));
  EXPECT_EQ(ProjectorProfile::load(folder_)->reference_distance_m, 1.2);
}

// A profile that was damaged at random is refused with a text, or it is a valid one all the same
// (white space of profile.json): never a crash, and never one that does not pass its own check.
TEST_F(ProfileTest, DamagedAtRandomItIsRefusedOrValid) {
  ASSERT_TRUE(example_with_residual().save(folder_));
  Pcg32 random(21);
  int refused = 0;
  constexpr int kTrials = 300;
  for (int i = 0; i < kTrials; ++i) {
    constexpr const char* kFiles[] = {
        "profile.json", "vignetting.exr", "surface_map.exr", "colour_residual.exr"};
    const std::filesystem::path path = folder_ / kFiles[random.next() % 4];
    const std::string whole = read_text(path).value();
    std::string damaged = whole;
    if (random.next() % 4 == 0) {
      damaged.resize(random.next() % damaged.size());
    } else {
      damaged[random.next() % damaged.size()] ^= static_cast<char>(1U << (random.next() % 8));
    }
    overwrite(path, damaged);
    const auto loaded = ProjectorProfile::load(folder_);
    if (loaded) {
      EXPECT_TRUE(loaded->check()) << "trial " << i;
    } else {
      ++refused;
      EXPECT_THAT(loaded.error().what, HasSubstr(folder_.string())) << "trial " << i;
    }
    overwrite(path, whole);
  }
  EXPECT_GT(refused, kTrials / 2);
  EXPECT_TRUE(ProjectorProfile::load(folder_));
}

// The same with checksums made right again, as by somebody who edits by program.
TEST_F(ProfileTest, WithWildValuesItIsRefusedOrValid) {
  ASSERT_TRUE(example_with_residual().save(folder_));
  const auto original = nlohmann::json::parse(read_text(folder_ / "profile.json").value());
  const std::vector<nlohmann::json> wild{nullptr,
                                         true,
                                         "",
                                         -1,
                                         0,
                                         1e308,
                                         -1e308,
                                         1 << 30,
                                         0.5,
                                         nlohmann::json::array(),
                                         nlohmann::json::object(),
                                         {1, 2},
                                         {{"a", 1}}};
  int refused = 0;
  int tried = 0;
  const nlohmann::json flat = original["profile"].flatten();
  for (const auto& [pointer, value] : flat.items()) {
    if (pointer.starts_with("/tone_curves") && !pointer.ends_with("/3")) continue;  // all alike
    for (const nlohmann::json& instead : wild) {
      nlohmann::json json = original;
      json["profile"][nlohmann::json::json_pointer(pointer)] = instead;
      json["checksum"] = json_checksum(json["profile"]);
      overwrite(folder_ / "profile.json", json.dump());
      const auto loaded = ProjectorProfile::load(folder_);
      ++tried;
      if (loaded) {
        EXPECT_TRUE(loaded->check()) << pointer << " = " << instead;
      } else {
        ++refused;
        EXPECT_THAT(loaded.error().what, HasSubstr(folder_.string()));
      }
    }
  }
  EXPECT_GT(refused, tried / 2);
}

TEST(ProfileWhite, IsFullDriveOverBlack) {
  ProjectorProfile p = example_profile();
  const Eigen::Vector3d one = Eigen::Vector3d::Ones();
  EXPECT_TRUE(p.white().isApprox(p.primaries * one + p.black));
  const Eigen::Vector3d segment(0.2, 0.3, 0.25);
  p.residual = ColourResidual::sampled(
      2, [&](const Eigen::Vector3d& t) -> Eigen::Vector3d { return t.minCoeff() * segment; });
  EXPECT_TRUE(p.white().isApprox(p.primaries * (one + segment) + p.black));
  EXPECT_EQ(p.emitted(Eigen::Vector3d::Zero()), Xyz::Zero());
  EXPECT_EQ(p.linear_drive({0, 15, 0}), Eigen::Vector3d::UnitY());
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

TEST(ProfileCheck, AcceptsTheExamples) {
  EXPECT_TRUE(example_profile().check());
  EXPECT_TRUE(example_with_map().check());
  EXPECT_TRUE(example_with_residual().check());
}

ColourResidual residual(const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& rho) {
  return ColourResidual::sampled(17, rho);
}

TEST(ProfileMaps, AreStretchedOverTheRasterBilinearly) {
  ProjectorProfile p = example_with_map();  // the raster is 64 x 48
  constexpr double kRounding = 1e-15;
  // Texel centres: the texels themselves; beyond the outermost ones nothing changes.
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 2; ++x)
      EXPECT_TRUE(p.reflectance_at({16 + 32 * x, 8 + 16 * y})
                      .isApprox(p.surface_map(x, y).cast<double>(), kRounding));
  EXPECT_EQ(p.reflectance_at({64, 48}), p.reflectance_at({48, 40}));
  EXPECT_EQ(p.vignetting_at({0, 0}), p.vignetting_at({64.0 / 6, 12}));
  // Between four: the weights of GL, here a quarter of the way right and three quarters down.
  const Eigen::Vector3d expected = (1 - 0.25 * 0.75) * p.surface_map(0, 1).cast<double>() +
                                   0.25 * 0.75 * p.surface_map(1, 2).cast<double>();
  EXPECT_TRUE(p.reflectance_at({24, 36}).isApprox(expected, kRounding));
  // A map's own size does not matter: one that is linear is looked up the same at any size.
  const auto ramp = [](int width, int height) {
    Image<float> map(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        map(x, y) = static_cast<float>(1 + (x + 0.5) / width + 2 * (y + 0.5) / height);
    return map;
  };
  for (const auto& [width, height] : {std::pair(4, 4), std::pair(64, 48), std::pair(7, 100)}) {
    p.vignetting = ramp(width, height);
    EXPECT_NEAR(p.vignetting_at({20, 30}), 1 + 20.0 / 64 + 2 * 30.0 / 48, 1e-6);
  }
  p.surface_map = {};
  EXPECT_EQ(p.reflectance_at({5, 6}), Eigen::Vector3d::Ones());
  p.vignetting = {};
  EXPECT_EQ(p.vignetting_at({5, 6}), 1.0);
}

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
      {"map", [](ProjectorProfile& p) { p.surface_map(0, 1).x() = 0; }},
      {"map", [](ProjectorProfile& p) { p.surface_map(1, 2).y() = std::nanf(""); }},
      {"map", [](ProjectorProfile& p) { p.surface_map(1, 0).z() = HUGE_VALF; }},
      {"map", [](ProjectorProfile& p) { p.surface_map(0, 0).x() = -1; }},
      {"map", [](ProjectorProfile& p) { p.surface_map(0, 0).y() = 0.5F * kLeastReflectance; }},
      {"map", [](ProjectorProfile& p) { p.surface_map(0, 0).z() = 2.0F / kLeastReflectance; }},
      {"folds",
       [](ProjectorProfile& p) {  // no light at all
         p.residual = residual([](const Eigen::Vector3d& t) -> Eigen::Vector3d { return -t; });
       }},
      {"folds",
       [](ProjectorProfile& p) {  // red falls from 0.5 on
         p.residual = residual([](const Eigen::Vector3d& t) {
           return Eigen::Vector3d(-2.0 * std::max(t.x() - 0.5, 0.0), 0.0, 0.0);
         });
       }},
      {"folds",
       [](ProjectorProfile& p) {  // green and blue change places: a mirror
         p.residual = residual([](const Eigen::Vector3d& t) {
           return Eigen::Vector3d(0.0, t.z() - t.y(), t.y() - t.z());
         });
       }},
      {"residual is not finite, or above",
       [](ProjectorProfile& p) {
         p.residual = residual([](const Eigen::Vector3d& t) -> Eigen::Vector3d { return 11 * t; });
       }},
      {"UTF-8", [](ProjectorProfile& p) { p.colour_model = "\xff"; }},
      {"UTF-8", [](ProjectorProfile& p) { p.record["when"] = "\xc3"; }},
      {"UTF-8", [](ProjectorProfile& p) { p.record["\x80"] = "now"; }},
  };
  for (std::size_t i = 0; i < mistakes.size(); ++i) {
    ProjectorProfile profile = example_with_map();
    mistakes[i].make(profile);
    const Status status = profile.check();
    ASSERT_FALSE(status) << "mistake " << i << ": " << mistakes[i].reason;
    EXPECT_EQ(status.error().code, Errc::kBadFormat);
    EXPECT_THAT(status.error().what, HasSubstr(mistakes[i].reason)) << "mistake " << i;
  }
}

}  // namespace
}  // namespace veneer::calibration
