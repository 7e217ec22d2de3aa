// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/folder/folder_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <tiffio.h>

#include <cmath>
#include <limits>
#include <string>

#include "base/files.h"
#include "base/image_files.h"
#include "base/testing/temporary_folder.h"
#include "capture/cameras/cameras.h"

namespace veneer::capture {
namespace {

using ::testing::HasSubstr;

class FolderCameraTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path at(const std::string& name) const {
    return folder_.path() / name;
  }
  /// A picture of 4 x 4 whose every pixel is (value, value + 1, value + 2).
  void write_colour(const std::string& name, std::uint16_t value, int size = 4) {
    const auto next = static_cast<std::uint16_t>(value + 1);
    const auto last = static_cast<std::uint16_t>(value + 2);
    const Image<Rgb16> picture(size, size, {value, next, last});
    ASSERT_TRUE(write_png(at(name), picture.view()));
  }
  Result<std::unique_ptr<Camera>> open(const std::string& keys = "") {
    auto toml = TomlReader::parse(
        fmt::format("driver = \"folder\"\npath = \"{}\"\n{}", folder_.path().string(), keys),
        "rig");
    VENEER_CHECK(toml.has_value());
    VENEER_ASSIGN(auto camera, open_camera(*toml));
    VENEER_TRY(toml->finish());
    return camera;
  }
  std::string error(const std::string& keys = "") {
    const auto camera = open(keys);
    return camera ? "no error" : camera.error().what;
  }

  TemporaryFolder folder_;
};

TEST_F(FolderCameraTest, GivesThePicturesInTheOrderOfTheirNamesAndThenEnds) {
  write_colour("b.png", 200);
  write_colour("a.png", 100);
  write_colour("c.png", 300);
  const auto camera = open("exposure_s = 0.5");
  ASSERT_TRUE(camera) << camera.error().what;
  for (std::uint16_t i = 1; i <= 3; ++i) {
    const auto frame = (*camera)->grab();
    ASSERT_TRUE(frame) << frame.error().what;
    const auto value = static_cast<std::uint16_t>(100 * i);
    EXPECT_EQ(
        frame->counts(3, 2),
        (Rgb16{
            value, static_cast<std::uint16_t>(value + 1), static_cast<std::uint16_t>(value + 2)}));
    EXPECT_EQ(frame->sequence, i);
    EXPECT_EQ(frame->exposure_s, 0.5);
    EXPECT_EQ(frame->full_scale, 65535);
  }
  const auto end = (*camera)->grab();
  ASSERT_FALSE(end);
  EXPECT_EQ(end.error().code, Errc::kDisconnected);
  EXPECT_THAT(end.error().what, HasSubstr("no more pictures"));
}

TEST_F(FolderCameraTest, EveryExposureHasARowOfItsOwn) {
  write_colour("1.png", 10);
  write_colour("2.png", 40);
  write_colour("3.png", 11);
  write_colour("4.png", 41);
  ASSERT_TRUE(write_text(at("exposures.csv"),
                         "file,exposure_s\r\n1.png,1/60\r\n2.png, 1/15\r\n3.png,0.01667\r\n\r\n"
                         "4.png,1/15\r\n"));
  const auto camera = open();
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_DOUBLE_EQ((*camera)->exposure_range().least_s, 1.0 / 60);
  EXPECT_DOUBLE_EQ((*camera)->exposure_range().most_s, 1.0 / 15);
  ASSERT_TRUE((*camera)->set_exposure(0.06));  // nearer to 1/15
  EXPECT_EQ((*camera)->grab()->counts(0, 0)[0], 40);
  ASSERT_TRUE((*camera)->set_exposure(0.02));  // nearer to 1/60
  EXPECT_EQ((*camera)->grab()->counts(0, 0)[0], 10);
  EXPECT_EQ((*camera)->grab()->counts(0, 0)[0], 11);
  EXPECT_EQ((*camera)->grab().error().code, Errc::kDisconnected);
  ASSERT_TRUE((*camera)->set_exposure(1.0 / 15));
  const auto last = (*camera)->grab();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->counts(0, 0)[0], 41);
  EXPECT_DOUBLE_EQ(last->exposure_s, 1.0 / 15);
}

TEST_F(FolderCameraTest, ExposuresThatAreNotThereAreRefusedWithTheRange) {
  write_colour("1.png", 10);
  write_colour("2.png", 40);
  ASSERT_TRUE(write_text(at("exposures.csv"), "1.png,0.25\n2.png,2\n"));
  const auto camera = open();
  ASSERT_TRUE(camera) << camera.error().what;
  for (const double wrong : {0.0,
                             -1.0,
                             0.1,
                             2.5,
                             std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()}) {
    const Status status = (*camera)->set_exposure(wrong);
    ASSERT_FALSE(status) << wrong;
    EXPECT_EQ(status.error().code, Errc::kInvalidOption);
    EXPECT_THAT(status.error().what, HasSubstr("0.25 to 2 s"));
  }
  EXPECT_THAT(error("exposure_s = 8.0"), HasSubstr("0.25 to 2 s"));
}

TEST_F(FolderCameraTest, EightBitsKeepTheirCounts) {
  const Image<Rgb8> picture(2, 2, {255, 7, 0});
  ASSERT_TRUE(write_png(at("1.png"), picture.view()));
  const auto camera = open("exposure_s = 1.0");
  ASSERT_TRUE(camera) << camera.error().what;
  const auto frame = (*camera)->grab();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->counts(1, 1), (Rgb16{255, 7, 0}));
  EXPECT_EQ(frame->full_scale, 255);
}

TEST_F(FolderCameraTest, FloatsAreScaledByFullScale) {
  Image<Rgb32f> picture(2, 1, Rgb32f(0.0F, 0.5F, 1.0F));
  picture(1, 0) = Rgb32f(-0.1F, 0.25F, 3.0F);
  ASSERT_TRUE(write_exr(at("1.exr"), picture.view()));
  ASSERT_TRUE(write_exr(at("2.exr"), {ExrChannel{"Y", Image<float>(2, 1, 0.5F)}}));
  const auto camera = open("exposure_s = 1.0\nfull_scale = 16000");
  ASSERT_TRUE(camera) << camera.error().what;
  const auto frame = (*camera)->grab();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->counts(0, 0), (Rgb16{0, 8000, 16000}));
  EXPECT_EQ(frame->counts(1, 0), (Rgb16{0, 4000, 16000}));
  EXPECT_EQ(frame->full_scale, 16000);
  EXPECT_EQ((*camera)->grab()->counts(1, 0), (Rgb16{8000, 8000, 8000}));
}

TEST_F(FolderCameraTest, FloatsThatAreNoNumbersAreRefused) {
  Image<Rgb32f> picture(2, 1, Rgb32f(0.0F, 0.5F, 1.0F));
  picture(1, 0).y() = std::numeric_limits<float>::quiet_NaN();
  ASSERT_TRUE(write_exr(at("1.exr"), picture.view()));
  EXPECT_THAT(error("exposure_s = 1.0"), HasSubstr("no finite numbers"));
}

TEST_F(FolderCameraTest, TiffAndPngGiveTheSameCounts) {
  cv::Mat picture(3, 2, CV_16UC3);
  Image<Rgb16> same(2, 3);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 2; ++x) {
      const auto red = static_cast<std::uint16_t>(1000 * y + x);
      picture.at<cv::Vec3w>(y, x) = cv::Vec3w(9, 50000, red);  // blue, green, red
      same(x, y) = {red, 50000, 9};
    }
  }
  ASSERT_TRUE(cv::imwrite(at("1.tiff").string(), picture));
  ASSERT_TRUE(write_png(at("2.png"), same.view()));
  ASSERT_TRUE(cv::imwrite(at("3.TIF").string(), cv::Mat(3, 2, CV_8UC1, cv::Scalar(77))));
  const cv::Mat floats(3, 2, CV_32FC3, cv::Scalar(2.0, -1.0, 0.2));
  ASSERT_TRUE(cv::imwrite(at("4.tif").string(), floats, {cv::IMWRITE_TIFF_COMPRESSION, 1}));
  ASSERT_TRUE(cv::imwrite(at("5.tif").string(), floats));  // OpenCV packs them as LogLuv
  const auto camera = open("exposure_s = 1.0");
  ASSERT_TRUE(camera) << camera.error().what;
  const auto tiff = (*camera)->grab();
  const auto png = (*camera)->grab();
  const auto grey = (*camera)->grab();
  ASSERT_TRUE(tiff && png && grey);
  EXPECT_TRUE(std::ranges::equal(tiff->counts.pixels(), png->counts.pixels()));
  EXPECT_EQ(tiff->full_scale, png->full_scale);
  EXPECT_EQ(grey->counts(1, 2), (Rgb16{77, 77, 77}));
  EXPECT_EQ(grey->full_scale, 255);
  const auto scaled = (*camera)->grab();
  ASSERT_TRUE(scaled) << scaled.error().what;
  EXPECT_EQ(scaled->counts(1, 2), (Rgb16{13107, 0, 65535}));
  const auto log_luv = (*camera)->grab();
  ASSERT_FALSE(log_luv);
  EXPECT_THAT(log_luv.error().what, HasSubstr("convert it"));
}

/// A grey TIFF as RAW converters write it, whose EXIF says how long it was exposed.
void write_tiff_with_exposure(const std::filesystem::path& path, double exposure_s) {
  TIFF* file = TIFFOpen(path.c_str(), "w");
  ASSERT_NE(file, nullptr);
  const auto describe = [&] {
    TIFFSetField(file, TIFFTAG_IMAGEWIDTH, 2);
    TIFFSetField(file, TIFFTAG_IMAGELENGTH, 1);
    TIFFSetField(file, TIFFTAG_BITSPERSAMPLE, 16);
    TIFFSetField(file, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(file, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    TIFFSetField(file, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  };
  describe();
  std::array<std::uint16_t, 2> row{123, 456};
  TIFFWriteScanline(file, row.data(), 0, 0);
  TIFFWriteDirectory(file);
  TIFFCreateEXIFDirectory(file);
  TIFFSetField(file, EXIFTAG_EXPOSURETIME, exposure_s);
  std::uint64_t exif = 0;
  TIFFWriteCustomDirectory(file, &exif);
  TIFFSetDirectory(file, 0);
  TIFFSetField(file, TIFFTAG_EXIFIFD, exif);
  TIFFRewriteDirectory(file);
  TIFFClose(file);
}

TEST_F(FolderCameraTest, ATiffSaysItselfHowLongItWasExposed) {
  write_tiff_with_exposure(at("1.tiff"), 0.25);
  write_tiff_with_exposure(at("2.tiff"), 0.5);
  const auto camera = open();
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_NEAR((*camera)->exposure_range().least_s, 0.25, 1e-6);
  EXPECT_NEAR((*camera)->exposure_range().most_s, 0.5, 1e-6);
  EXPECT_EQ((*camera)->grab()->counts(1, 0), (Rgb16{456, 456, 456}));
  // What is written beside them counts more, and a picture that says nothing needs it.
  ASSERT_TRUE(write_text(at("exposures.csv"), "1.tiff,3\n2.tiff,4\n"));
  EXPECT_EQ(open().value()->exposure_range().most_s, 4);
  std::filesystem::remove(at("exposures.csv"));
  ASSERT_TRUE(cv::imwrite(at("3.tiff").string(), cv::Mat(1, 2, CV_16UC1, cv::Scalar(7))));
  EXPECT_THAT(error(), HasSubstr("3.tiff does not say"));
}

TEST_F(FolderCameraTest, ADamagedPictureIsAnErrorThatNamesIt) {
  write_colour("1.png", 10);
  ASSERT_TRUE(write_text(at("2.tiff"), "II*\0 and no more"));
  const auto camera = open("exposure_s = 1.0");
  ASSERT_TRUE(camera) << camera.error().what;
  ASSERT_TRUE((*camera)->grab());
  const auto damaged = (*camera)->grab();
  ASSERT_FALSE(damaged);
  EXPECT_EQ(damaged.error().code, Errc::kBadFormat);
  EXPECT_THAT(damaged.error().what, HasSubstr("2.tiff"));
}

TEST_F(FolderCameraTest, JpegIsRefusedUnlessItIsAllowed) {
  ASSERT_TRUE(cv::imwrite(at("1.jpg").string(), cv::Mat(8, 8, CV_8UC3, cv::Scalar(90, 90, 90))));
  EXPECT_THAT(error("exposure_s = 1.0"), HasSubstr("allow_encoded = true"));
  const auto camera = open("exposure_s = 1.0\nallow_encoded = true");
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_EQ((*camera)->grab()->full_scale, 255);
  // Beside linear pictures the camera's own JPEG are left alone, and never mixed with them.
  write_colour("1.png", 10, 8);
  EXPECT_THAT(open("exposure_s = 1.0").value()->description(), HasSubstr("1 pictures"));
  EXPECT_THAT(error("exposure_s = 1.0\nallow_encoded = true"), HasSubstr("takes both"));
}

TEST_F(FolderCameraTest, AFolderWithoutPicturesSaysWhatIsMissing) {
  EXPECT_THAT(error("exposure_s = 1.0"), HasSubstr("no PNG, TIFF or EXR"));
  ASSERT_TRUE(write_text(at("IMG_1.CR2"), "raw"));
  EXPECT_THAT(error("exposure_s = 1.0"), HasSubstr("dcraw -4 -T"));
  auto toml = TomlReader::parse("driver = \"folder\"\npath = \"/no/such/folder\"", "rig");
  EXPECT_EQ(open_camera(*toml).error().code, Errc::kNotFound);
  auto without = TomlReader::parse("driver = \"folder\"", "rig");
  EXPECT_THAT(open_camera(*without).error().what, HasSubstr("set path"));
}

TEST_F(FolderCameraTest, ExposuresThatAreNotKnownOrWrongAreRefused) {
  write_colour("1.png", 10);
  write_colour("2.png", 40);
  EXPECT_THAT(error(), HasSubstr("exposures.csv"));
  EXPECT_THAT(error("exposure_s = 0.0"), HasSubstr("above 0"));
  const auto with = [&](const std::string& lines) {
    EXPECT_TRUE(write_text(at("exposures.csv"), lines));
    return error();
  };
  EXPECT_THAT(with("1.png,1\n"), HasSubstr("no line for 2.png"));
  EXPECT_THAT(with("1.png,1\n2.png,1\n3.png,1\n"), HasSubstr("names 3.png"));
  EXPECT_THAT(with("1.png,1\n1.png,2\n2.png,1\n"), HasSubstr("a second time"));
  for (const std::string wrong :
       {"", "x", "0", "-1", "1/0", "0/0", "1/", "1/x", "nan", "inf", "1 s"}) {
    EXPECT_THAT(with(fmt::format("1.png,1\n2.png,{}\n", wrong)), HasSubstr("line 2")) << wrong;
  }
  EXPECT_THAT(with("1.png 1\n"), HasSubstr("line 1"));
}

TEST_F(FolderCameraTest, APictureOfAnotherSizeIsRefused) {
  write_colour("1.png", 10);
  write_colour("2.png", 40, 6);
  const auto camera = open("exposure_s = 1.0");
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_EQ((*camera)->width(), 4);
  ASSERT_TRUE((*camera)->grab());
  const auto frame = (*camera)->grab();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().code, Errc::kBadFormat);
  EXPECT_THAT(frame.error().what, HasSubstr("6 x 6 pixels, the first of the series 4 x 4"));
}

TEST_F(FolderCameraTest, AMosaicIsGreyAndWholeCells) {
  const Image<Rgb16> grey(6, 4, {500, 500, 500});
  ASSERT_TRUE(write_png(at("1.png"), grey.view()));
  const auto camera = open("exposure_s = 1.0\nlayout = \"polarsens-mono\"");
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_EQ((*camera)->grab()->mosaic, Mosaic::kPolarMono);
  EXPECT_THAT(error("exposure_s = 1.0\nlayout = \"polarsens-colour\""), HasSubstr("4 x 4"));
  EXPECT_THAT(error("exposure_s = 1.0\nlayout = \"bayer\""), HasSubstr("polarsens-mono"));
  write_colour("1.png", 10);
  EXPECT_THAT(open("exposure_s = 1.0\nlayout = \"polarsens-mono\"").value()->grab().error().what,
              HasSubstr("it has colours"));
}

TEST_F(FolderCameraTest, FullScaleIsACountOfSixteenBits) {
  write_colour("1.png", 10);
  for (const int wrong : {0, -1, 65536}) {
    EXPECT_THAT(error(fmt::format("exposure_s = 1.0\nfull_scale = {}", wrong)),
                HasSubstr("1 to 65535"));
  }
  EXPECT_EQ(open("exposure_s = 1.0\nfull_scale = 16383").value()->grab()->full_scale, 16383);
}

TEST_F(FolderCameraTest, HasNeitherGainNorFormatsNorTrigger) {
  write_colour("1.png", 10);
  EXPECT_THAT(error("exposure_s = 1.0\ngain_db = 3.0"), HasSubstr("gain"));
  EXPECT_THAT(error("exposure_s = 1.0\npixel_format = \"Mono8\""), HasSubstr("pixel format"));
  EXPECT_THAT(error("exposure_s = 1.0\ntrigger = \"software\""), HasSubstr("trigger"));
  EXPECT_TRUE(open("exposure_s = 1.0\ntrigger = \"free\""));
}

}  // namespace
}  // namespace veneer::capture
