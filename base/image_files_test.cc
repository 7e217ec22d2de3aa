// SPDX-License-Identifier: Apache-2.0
#include "base/image_files.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdlib>
#include <limits>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/full_disk.h"
#include "base/testing/temporary_folder.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;

template <class Pixel>
Image<Pixel> noise(int width, int height) {
  Pcg32 random(7);
  Image<Pixel> image(width, height);
  for (Pixel& pixel : image.pixels()) {
    for (auto& channel : pixel)
      channel = static_cast<std::remove_reference_t<decltype(channel)>>(random.next());
  }
  return image;
}

template <class Pixel>
bool same(const Image<Pixel>& a, const Image<Pixel>& b) {
  return a.width() == b.width() && a.height() == b.height() &&
         std::ranges::equal(a.pixels(), b.pixels());
}

/// `result` is the refusal of a header that claims an absurd size.
template <class Image>
testing::AssertionResult refused_for_its_size(const Result<Image>& result) {
  if (result) return testing::AssertionFailure() << "it was read";
  if (result.error().code == Errc::kBadFormat &&
      result.error().what.find("pixels, more than") != std::string::npos) {
    return testing::AssertionSuccess();
  }
  return testing::AssertionFailure() << result.error().what;
}

TEST(Image, StartsBlackWhateverThePixel) {
  const Image<Rgb32f> image(3, 2);
  for (const Rgb32f& pixel : image.pixels()) EXPECT_EQ(pixel, Rgb32f::Zero());
}

TEST(Png, RoundTripsEightBits) {
  const TemporaryFolder folder;
  const auto image = noise<Rgb8>(17, 9);
  ASSERT_TRUE(write_png(folder.path() / "a.png", image.view()));
  EXPECT_TRUE(same(read_png(folder.path() / "a.png").value(), image));
}

TEST(Png, RoundTripsSixteenBits) {
  const TemporaryFolder folder;
  const auto image = noise<Rgb16>(5, 31);
  ASSERT_TRUE(write_png(folder.path() / "a.png", image.view()));
  EXPECT_TRUE(same(read_png16(folder.path() / "a.png").value(), image));
}

TEST(Png, WritesAViewWithPadding) {
  const TemporaryFolder folder;
  const auto image = noise<Rgb8>(8, 4);
  const ImageView<const Rgb8> part(image.pixels().data() + 2, 3, 4, 8);
  ASSERT_TRUE(write_png(folder.path() / "a.png", part));
  const Image<Rgb8> read = read_png(folder.path() / "a.png").value();
  ASSERT_EQ(read.width(), 3);
  EXPECT_EQ(read(1, 2), image(3, 2));
}

TEST(Png, RefusesDamagedAndMissingFiles) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.png";
  EXPECT_EQ(read_png(path).error().code, Errc::kNotFound);
  const auto image = noise<Rgb8>(40, 40);
  ASSERT_TRUE(write_png(path, image.view()));
  const std::string whole = read_text(path).value();
  for (const std::size_t kept :
       {std::size_t{0}, std::size_t{7}, std::size_t{40}, whole.size() / 2}) {
    ASSERT_TRUE(write_text(path, whole.substr(0, kept)));
    const auto cut = read_png(path);
    ASSERT_FALSE(cut) << kept << " bytes kept";
    EXPECT_EQ(cut.error().code, Errc::kBadFormat);
  }
}

TEST(Png, RefusesAHeaderThatClaimsAnAbsurdSize) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.png";
  const auto image = noise<Rgb8>(4, 4);
  ASSERT_TRUE(write_png(path, image.view()));
  std::string bytes = read_text(path).value();
  bytes.replace(16, 8, std::string("\x00\x0f\x42\x40\x00\x0f\x42\x40", 8));  // 10^6 x 10^6
  bytes.replace(29, 4, "\xd3\x0f\xaf\x2a");                                  // the CRC of that
  ASSERT_TRUE(write_text(path, bytes));
  EXPECT_TRUE(refused_for_its_size(read_png(path)));
}

TEST(Exr, RoundTripsFloatsBitByBit) {
  const TemporaryFolder folder;
  std::vector<ExrChannel> channels{{"a", Image<float>(3, 2)}, {"specular.R", Image<float>(3, 2)}};
  channels[0].pixels(2, 1) = 1e-30F;
  channels[0].pixels(0, 0) = std::numeric_limits<float>::infinity();
  channels[1].pixels(1, 0) = -65505.5F;
  ASSERT_TRUE(write_exr(folder.path() / "a.exr", channels));
  const std::vector<ExrChannel> read = read_exr(folder.path() / "a.exr").value();
  ASSERT_EQ(read.size(), 2U);
  for (std::size_t c = 0; c < 2; ++c) {
    EXPECT_EQ(read[c].name, channels[c].name);
    EXPECT_TRUE(std::ranges::equal(read[c].pixels.pixels(), channels[c].pixels.pixels()));
  }
}

TEST(Exr, KeepsWhatIsToBeKnownAboutThePicture) {
  const TemporaryFolder folder;
  const ExrAttributes attributes{
      {"veneer.exposure_s", "0.033333333333333333"},
      {"veneer.empty", ""},
      {"veneer.a_name_that_is_longer_than_the_31_bytes_of_old", std::string(70000, 'x')},
      {"veneer.camera", "a \"camera\"\nof \xc3\xa9mail"}};
  std::vector<ExrChannel> channels{{"Y", Image<float>(3, 2, 1.5F)}};
  ASSERT_TRUE(write_exr(folder.path() / "a.exr", channels, attributes));
  const auto picture = read_exr_picture(folder.path() / "a.exr");
  ASSERT_TRUE(picture) << picture.error().what;
  EXPECT_EQ(picture->attributes, attributes);
  ASSERT_EQ(picture->channels.size(), 1U);
  EXPECT_EQ(picture->channels[0].pixels(2, 1), 1.5F);
  // One of OpenEXR's own that is no text.
  const Status taken = write_exr(folder.path() / "b.exr", channels, {{"dataWindow", "x"}});
  ASSERT_FALSE(taken);
  EXPECT_FALSE(fs::exists(folder.path() / "b.exr"));
}

// The last part of the file is written when it is closed.
TEST(Exr, OnAFullDiskIsWholeOrNotAtAll) {
  const TemporaryFolder folder;
  Image<float> pixels(40, 30);
  Pcg32 random(3);
  for (float& pixel : pixels.pixels()) pixel = static_cast<float>(random.next());
  const std::vector<ExrChannel> channels{{"Y", std::move(pixels)}};
  ASSERT_TRUE(write_exr(folder.path() / "whole.exr", channels));
  const auto size = static_cast<rlim_t>(fs::file_size(folder.path() / "whole.exr"));
  for (const rlim_t limit : {rlim_t{1}, rlim_t{300}, size / 2, size - 100, size - 1, size}) {
    const fs::path path = folder.path() / std::to_string(limit);
    const int status = on_full_disk(limit, [&] {
      const Status written = write_exr(path, channels);
      return written ? 0 : written.error().code == Errc::kIo ? 1 : 2;
    });
    EXPECT_EQ(status, limit < size ? 1 : 0) << limit << " of " << size;
    EXPECT_EQ(fs::exists(path), limit >= size) << limit << " of " << size;
  }
}

TEST(Exr, NamesTheMissingChannel) {
  const TemporaryFolder folder;
  const Image<Rgb32f> xyz(2, 2);
  ASSERT_TRUE(write_exr(folder.path() / "a.exr", xyz.view(), {"X", "Y", "Z"}));
  EXPECT_TRUE(read_exr_rgb(folder.path() / "a.exr", {"X", "Y", "Z"}));
  const auto image = read_exr_rgb(folder.path() / "a.exr");
  ASSERT_FALSE(image);
  EXPECT_NE(image.error().what.find("channel R"), std::string::npos) << image.error().what;
}

TEST(Exr, RefusesATruncatedFile) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.exr";
  const Image<Rgb32f> image(64, 64, Rgb32f(1, 2, 3));
  ASSERT_TRUE(write_exr(path, image.view()));
  const std::string whole = read_text(path).value();
  ASSERT_TRUE(write_text(path, whole.substr(0, whole.size() / 2)));
  EXPECT_EQ(read_exr(path).error().code, Errc::kBadFormat);
}

TEST(Exr, RefusesAHeaderThatClaimsAnAbsurdSize) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.exr";
  const Image<Rgb32f> image(2, 2);
  ASSERT_TRUE(write_exr(path, image.view()));
  std::string bytes = read_text(path).value();
  const std::string name("dataWindow\0box2i\0\x10\0\0\0", 21);  // then min x, y and max x, y
  const std::size_t window = bytes.find(name);
  ASSERT_NE(window, std::string::npos);
  const std::string max_1023_1048575("\xff\x03\0\0\xff\xff\x0f\0", 8);
  bytes.replace(window + name.size() + 8, 8, max_1023_1048575);
  bytes.append(std::size_t{1} << 20, '\0');  // the table of rows, which is read with the header
  ASSERT_TRUE(write_text(path, bytes));
  EXPECT_TRUE(refused_for_its_size(read_exr(path)));
}

TEST(Jpeg, RefusesWhatIsNoJpeg) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "a.jpg", "no picture"));
  EXPECT_EQ(read_jpeg(folder.path() / "a.jpg").error().code, Errc::kBadFormat);
  EXPECT_EQ(read_jpeg(folder.path() / "b.jpg").error().code, Errc::kNotFound);
}

TEST(Jpeg, RefusesAHeaderThatClaimsAnAbsurdSize) {
  const TemporaryFolder folder;
  // A progressive picture of one component, 65280 x 65280, up to the start of its first scan.
  static constexpr char kHeader[] =
      "\xff\xd8"
      "\xff\xc2\x00\x0b\x08\xff\x00\xff\x00\x01\x01\x11\x00"
      "\xff\xda\x00\x08\x01\x01\x00\x00\x00\x00";
  ASSERT_TRUE(write_text(folder.path() / "a.jpg", std::string(kHeader, sizeof kHeader - 1)));
  EXPECT_TRUE(refused_for_its_size(read_jpeg(folder.path() / "a.jpg")));
}

TEST(Jpeg, ReadsARealPhotographAndRefusesHalfOfIt) {
  const char* data = std::getenv("VENEER_DATA");
  const fs::path photographs = fs::path(data == nullptr ? "" : data) / "rti_loewenkopf" / "jpg";
  if (!fs::is_directory(photographs)) GTEST_SKIP() << "real data absent: " << photographs;
  const fs::path photograph = fs::directory_iterator(photographs)->path();
  const Image<Rgb8> image = read_jpeg(photograph).value();
  EXPECT_EQ(image.width(), 64);
  EXPECT_EQ(image.height(), 43);
  const TemporaryFolder folder;
  const std::string whole = read_text(photograph).value();
  ASSERT_TRUE(write_text(folder.path() / "half.jpg", whole.substr(0, whole.size() / 2)));
  EXPECT_EQ(read_jpeg(folder.path() / "half.jpg").error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer
