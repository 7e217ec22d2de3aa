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
#include "calibration/internal_profile_testing.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

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

}  // namespace
}  // namespace veneer::calibration
