// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/rti/rti.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "base/colour.h"
#include "base/files.h"
#include "base/image_files.h"
#include "base/testing/temporary_folder.h"
#include "btf/sample_set.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLp = "3\na.png 0 0 2\nb.png 0.5 0 0.5\nc.png 0 -0.3 0.4\n";

// Three small pictures whose pixels say which picture, column and row they are.
class RtiFolder : public ::testing::Test {
 protected:
  RtiFolder() {
    for (int i = 0; i < 3; ++i)
      write_picture(std::string(1, static_cast<char>('a' + i)) + ".png", i, 4, 2);
    write_lp(kLp);
  }
  void write_picture(const std::string& name, int number, int width, int height) {
    Image<Rgb8> image(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        image(x, y) = {static_cast<std::uint8_t>(100 * number),
                       static_cast<std::uint8_t>(50 * x),
                       static_cast<std::uint8_t>(200 * y)};
    ASSERT_TRUE(write_png(folder_.path() / "in" / name, image.view()));
  }
  void write_lp(const std::string& text) {
    ASSERT_TRUE(write_text(folder_.path() / "in" / "lights.lp", text));
  }
  Status import(const ImportOptions& options = {}) {
    SilentProgress progress;
    return import_rti(folder_.path() / "in", out(), options, progress);
  }
  [[nodiscard]] fs::path out() const { return folder_.path() / "out.btfset"; }
  void expect_refused(Errc code, const std::string& says) {
    const Status status = import();
    ASSERT_FALSE(status) << says;
    EXPECT_EQ(status.error().code, code) << status.error().what;
    EXPECT_NE(status.error().what.find(says), std::string::npos) << status.error().what;
    EXPECT_FALSE(fs::exists(out())) << "a half-written set";
  }
  TemporaryFolder folder_;
};

void expect_picture_samples(const SampleSet& set, int x0, int y0) {
  for (int y = 0; y < set.info().height; ++y) {
    for (int x = 0; x < set.info().width; ++x) {
      std::vector<float> rgb(9);
      set.rgb(y * set.info().width + x, Part::kTotal, rgb);
      for (int light = 0; light < 3; ++light) {
        const std::array<int, 3> code{100 * light, 50 * (x + x0), 200 * (y + y0)};
        for (std::size_t c = 0; c < 3; ++c) {
          const double expected = srgb_decode(code[c] / 255.0);
          EXPECT_NEAR(
              rgb[static_cast<std::size_t>(light) * 3 + c], expected, expected * 5e-4);  // float16
        }
      }
    }
  }
}

TEST_F(RtiFolder, BecomesASetOfOneView) {
  const Status status = import();
  ASSERT_TRUE(status) << status.error().what;
  const auto set = SampleSet::open(out());
  ASSERT_TRUE(set) << set.error().what;
  EXPECT_EQ(set->info().width, 4);
  EXPECT_EQ(set->info().height, 2);
  ASSERT_EQ(set->info().views.size(), 1U);
  EXPECT_EQ(set->info().views[0], Direction::UnitZ());
  EXPECT_LT((set->info().lights[2] - Direction(0, -0.6, 0.8)).norm(), 1e-14);
  expect_picture_samples(*set, 0, 0);
}

TEST_F(RtiFolder, KeepsTheCrop) {
  ASSERT_TRUE(import({Crop{1, 1, 2, 1}}));
  const auto set = SampleSet::open(out());
  ASSERT_TRUE(set);
  EXPECT_EQ(set->info().texel_count(), 2);
  expect_picture_samples(*set, 1, 1);
  const Status outside = import({Crop{3, 0, 2, 1}});
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error().code, Errc::kInvalidOption);
}

TEST_F(RtiFolder, FindsPicturesWhoseNamesChanged) {
  // Folders of another system, another extension and case, Windows line ends, spaces in a name.
  fs::create_directory(folder_.path() / "in" / "deep");
  fs::rename(folder_.path() / "in" / "b.png", folder_.path() / "in" / "deep" / "my b.PNG");
  write_lp("3\r\nC:\\scans\\A.tif 0 0 2\r\nold/My b.jpg\t0.5 0 0.5\r\n\r\nc.png 0 -0.3 0.4\r\n");
  const Status status = import();
  ASSERT_TRUE(status) << status.error().what;
  expect_picture_samples(*SampleSet::open(out()), 0, 0);
}

TEST_F(RtiFolder, TakesTheLpFileItself) {
  SilentProgress progress;
  ASSERT_TRUE(import_rti(folder_.path() / "in" / "lights.lp", out(), {}, progress));
  fs::remove_all(out());
  ASSERT_TRUE(write_text(folder_.path() / "in" / "other.LP", kLp));
  expect_refused(Errc::kInvalidOption, "2 .lp files");
}

TEST_F(RtiFolder, SaysWhatIsWrong) {
  write_lp("");
  expect_refused(Errc::kBadFormat, "empty");
  write_lp("three\n");
  expect_refused(Errc::kBadFormat, "line 1");
  write_lp("-3\n");
  expect_refused(Errc::kBadFormat, "line 1");
  write_lp("4\na.png 0 0 1\nb.png 0 1 1\nc.png 1 0 1\n");
  expect_refused(Errc::kBadFormat, "states 4 pictures, but 3 follow");
  write_lp("2\na.png 0 0 1\nb.png 0 1 1\nc.png 1 0 1\n");
  expect_refused(Errc::kBadFormat, "states 2 pictures, but 3 follow");
  write_lp("1\na.png 0 0\n");
  expect_refused(Errc::kBadFormat, "line 2");
  write_lp("1\n 0 0 1\n");
  expect_refused(Errc::kBadFormat, "no name");
  write_lp("1\na.png 0 x 1\n");
  expect_refused(Errc::kBadFormat, "line 2");
  write_lp("1\na.png 0 nan 1\n");
  expect_refused(Errc::kBadFormat, "line 2");
  write_lp("1\na.png 0 0 0\n");
  expect_refused(Errc::kBadFormat, "zero vector");
  write_lp("1\na.png 0 0.5 -0.1\n");
  expect_refused(Errc::kBadFormat, "below the surface");
  write_lp("3\na.png 0 0 2\nb.png 0 1 1\nc.png 0 0 5\n");
  expect_refused(Errc::kBadFormat, "lines 2 and 4 have the same light");
  write_lp("2\na.png 0 0 1\nlost.png 0 1 1\n");
  expect_refused(Errc::kNotFound, "lost.png");
}

TEST_F(RtiFolder, RefusesDamagedPictures) {
  write_picture("b.png", 1, 4, 3);
  expect_refused(Errc::kBadFormat, "4 x 3 pixels");
  ASSERT_TRUE(write_text(folder_.path() / "in" / "b.png", "no picture"));
  expect_refused(Errc::kBadFormat, "b.png");
}

TEST_F(RtiFolder, RefusesAmbiguousPictures) {
  fs::create_directory(folder_.path() / "in" / "x");
  fs::create_directory(folder_.path() / "in" / "y");
  for (const char* copy : {"x/b.png", "y/b.png"})
    fs::copy_file(folder_.path() / "in" / "b.png", folder_.path() / "in" / copy);
  fs::remove(folder_.path() / "in" / "b.png");
  expect_refused(Errc::kBadFormat, "keep one");
}

TEST_F(RtiFolder, TakesABareFileNameFromTheFolderOneStandsIn) {
  const fs::path before = fs::current_path();
  fs::current_path(folder_.path() / "in");
  SilentProgress progress;
  const Status status = import_rti("lights.lp", folder_.path() / "bare.btfset", {}, progress);
  fs::current_path(before);
  EXPECT_TRUE(status) << status.error().what;
}

TEST_F(RtiFolder, MissingFolderIsNotFound) {
  fs::remove_all(folder_.path() / "in");
  expect_refused(Errc::kNotFound, "importing");
}

TEST(Rti, ImportsTheLionHead) {
  const char* data = std::getenv("VENEER_DATA");
  const fs::path lion = fs::path(data == nullptr ? "" : data) / "rti_loewenkopf";
  if (!fs::exists(lion)) GTEST_SKIP() << "real data absent: " << lion;
  const TemporaryFolder folder;
  SilentProgress progress;
  const Status status = import_rti(lion, folder.path() / "lion.btfset", {}, progress);
  ASSERT_TRUE(status) << status.error().what;
  const auto set = SampleSet::open(folder.path() / "lion.btfset");
  ASSERT_TRUE(set) << set.error().what;
  EXPECT_EQ(set->info().width, 64);
  EXPECT_EQ(set->info().height, 43);
  EXPECT_EQ(set->info().lights.size(), 240U);
  EXPECT_TRUE(set->check_finite());
  // The head stands out from its board, so light from one side leaves the other darker: the mean
  // over lights of value times direction points up from the surface.
  std::vector<float> rgb(720);
  Direction sum = Direction::Zero();
  for (int texel = 0; texel < set->info().texel_count(); ++texel) {
    set->rgb(texel, Part::kTotal, rgb);
    for (std::size_t light = 0; light < 240; ++light)
      sum += static_cast<double>(rgb[3 * light + 1]) * set->info().lights[light];
  }
  EXPECT_GT(sum.normalized().z(), 0.9);
}

}  // namespace
}  // namespace veneer::btf
