// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/ubo2003/ubo2003.h"

// jpeglib.h uses FILE and size_t without including what declares them.
// clang-format off
#include <cstdio>

#include <jpeglib.h>
// clang-format on

#include <gtest/gtest.h>
#include <zip.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <numbers>

#include "base/files.h"
#include "btf/importers/internal_test_files.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;

constexpr int kSize = 16;  // pixels: 2 x 2 blocks of JPEG, each of one colour
const std::vector<std::pair<int, int>> kViews{{0, 0}, {30, 90}, {75, 345}};
const std::vector<std::pair<int, int>> kLights{{0, 0}, {45, 20}};

int code_of(std::size_t view, std::size_t light, int x, int y, int c) {
  return 30 + 40 * static_cast<int>(view) + 25 * static_cast<int>(light) + 35 * (x / 8) +
         20 * (y / 8) + 8 * c;
}

std::string jpeg(int width, int height, const std::function<int(int, int, int)>& code) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &data, &size);
  info.image_width = static_cast<JDIMENSION>(width);
  info.image_height = static_cast<JDIMENSION>(height);
  info.input_components = 3;
  info.in_color_space = JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, 100, TRUE);
  for (int c = 0; c < 3; ++c) info.comp_info[c].h_samp_factor = info.comp_info[c].v_samp_factor = 1;
  jpeg_start_compress(&info, TRUE);
  for (int y = 0; y < height; ++y) {
    std::vector<JSAMPLE> row;
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) row.push_back(static_cast<JSAMPLE>(code(x, y, c)));
    JSAMPROW pointer = row.data();
    jpeg_write_scanlines(&info, &pointer, 1);
  }
  jpeg_finish_compress(&info);
  std::string bytes(reinterpret_cast<const char*>(data), size);
  jpeg_destroy_compress(&info);
  std::free(data);
  return bytes;
}

using Files = std::map<std::string, std::string>;

std::string name_of(std::size_t view, std::size_t light) {
  return fmt::format("tl{:03} pl{:03} tv{:03} pv{:03}.jpg",
                     kLights[light].first,
                     kLights[light].second,
                     kViews[view].first,
                     kViews[view].second);
}

// Folders and indices as in the real archives; indices run against the directions.
Files all_pictures() {
  Files files{{"set/readme.txt", "no picture"}, {"set/._tl000 pl000 tv000 pv000.jpg", "nothing"}};
  int index = 99;
  for (std::size_t v = 0; v < kViews.size(); ++v)
    for (std::size_t l = 0; l < kLights.size(); ++l)
      files[fmt::format("set/tv{:03}/{:05} {}", kViews[v].first, index--, name_of(v, l))] =
          jpeg(kSize, kSize, [&](int x, int y, int c) { return code_of(v, l, x, y, c); });
  return files;
}

void write_folder(const fs::path& folder, const Files& files) {
  fs::remove_all(folder);
  for (const auto& [name, bytes] : files) ASSERT_TRUE(write_text(folder / name, bytes));
}

void write_zip(const fs::path& path, const Files& files) {
  fs::remove_all(path);
  int error = 0;
  zip_t* archive = zip_open(path.c_str(), ZIP_CREATE, &error);
  ASSERT_NE(archive, nullptr);
  for (const auto& [name, bytes] : files)
    ASSERT_GE(
        zip_file_add(
            archive, name.c_str(), zip_source_buffer(archive, bytes.data(), bytes.size(), 0), 0),
        0);
  ASSERT_EQ(zip_close(archive), 0);
}

// Rounding of JPEG's transforms at quality 100, in codes.
constexpr double kJpeg = 3.0;

void expect_law(const SampleSet& set, int x0 = 0, int y0 = 0) {
  ASSERT_EQ(set.info().views.size(), kViews.size());
  ASSERT_EQ(set.info().lights.size(), kLights.size());
  EXPECT_NEAR(angles_from_direction(set.info().views[2]).phi, 345.0 * std::numbers::pi / 180, 1e-9);
  EXPECT_NEAR(angles_from_direction(set.info().lights[1]).theta, std::numbers::pi / 4, 1e-9);
  for (int texel = 0; texel < set.info().texel_count(); ++texel) {
    const std::vector<float> samples = testing::samples_of(set, texel);
    std::size_t i = 0;
    for (std::size_t v = 0; v < kViews.size(); ++v)
      for (std::size_t l = 0; l < kLights.size(); ++l)
        for (int c = 0; c < 3; ++c) {
          const int code =
              code_of(v, l, x0 + texel % set.info().width, y0 + texel / set.info().width, c);
          ASSERT_NEAR(255.0 * std::pow(samples[i++], 1.0 / 2.2), code, kJpeg)
              << texel << " " << v << " " << l;
        }
  }
}

TEST(Ubo2003, ReadsAnArchiveAndAFolder) {
  const testing::ImportedFile zip("ubo2003", "wool.zip");
  write_zip(zip.path(), all_pictures());
  const SampleSet set = zip.set();
  EXPECT_EQ(set.info().width, kSize);
  expect_law(set);
  expect_law(zip.set({Crop{6, 5, 3, 9}}), 6, 5);
  const testing::ImportedFile folder("ubo2003", "wool");
  write_folder(folder.path(), all_pictures());
  expect_law(folder.set());
}

TEST(Ubo2003, NamesMayBeWrittenInMoreWays) {
  const testing::ImportedFile folder("ubo2003", "wool");
  Files files;
  for (std::size_t v = 0; v < kViews.size(); ++v)
    for (std::size_t l = 0; l < kLights.size(); ++l)
      files[fmt::format("Bottl_TL {}_PL{}-tv{} pv {}.JPEG",
                        kLights[l].first,
                        // The azimuth of the normal means nothing.
                        kLights[l].first == 0 ? 60 : kLights[l].second,
                        kViews[v].first,
                        kViews[v].second + (kViews[v].second == 0 ? 360 : 0))] =
          jpeg(kSize, kSize, [&](int x, int y, int c) { return code_of(v, l, x, y, c); });
  write_folder(folder.path(), files);
  expect_law(folder.set());
}

TEST(Ubo2003, SaysWhatIsWrong) {
  const testing::ImportedFile folder("ubo2003", "wool");
  const Files good = all_pictures();
  const auto with = [&](const std::string& name, const std::string& bytes) {
    Files files = good;
    files[name] = bytes;
    write_folder(folder.path(), files);
  };
  with("again/" + name_of(1, 1), good.rbegin()->second);
  folder.expect_refused("show the same pair");
  with("tl015 pl000 tv000 pv000.jpg", good.rbegin()->second);
  folder.expect_refused("is missing (7 of 9 are there)");
  write_folder(folder.path(), {{"a.txt", ""}, {"tl099 pl000 tv000 pv000.jpg", ""}});
  folder.expect_refused("no picture with a name");
  for (const auto& [name, bytes] : good) {
    if (!name.ends_with("tl045 pl020 tv030 pv090.jpg")) continue;
    with(name, jpeg(kSize, kSize + 1, [](int, int, int) { return 9; }));
    folder.expect_refused("has 16 x 17 pixels");
    with(name, bytes.substr(0, bytes.size() / 2));
    folder.expect_refused(name_of(1, 1));
    with(name, "no picture");
    folder.expect_refused(name_of(1, 1));
    Files files = good;
    files.erase(name);
    write_folder(folder.path(), files);
    folder.expect_refused("the picture " + name_of(1, 1) + " is missing");
  }
  fs::remove_all(folder.path());
  folder.expect_refused("no such folder", Errc::kNotFound);
}

TEST(Ubo2003, DamagedArchivesAreRefused) {
  const testing::ImportedFile zip("ubo2003", "wool.zip");
  write_zip(zip.path(), all_pictures());
  const std::string bytes = read_text(zip.path()).value();
  for (std::size_t size = 0; size < bytes.size(); size += bytes.size() / 60) {
    zip.write(bytes.substr(0, size));
    ASSERT_FALSE(zip.import()) << size;
    ASSERT_FALSE(fs::exists(zip.out()));
  }
  zip.expect_flips_survived(bytes, bytes.size(), 150);
  // A picture whose bytes are not those that were packed.
  std::string damaged = bytes;
  const std::size_t content = bytes.find("tv000 pv000.jpg", bytes.find("readme")) + 200;
  damaged[content] = static_cast<char>(damaged[content] ^ 1);
  zip.write(damaged);
  EXPECT_FALSE(zip.import());
}

}  // namespace
}  // namespace veneer::btf
