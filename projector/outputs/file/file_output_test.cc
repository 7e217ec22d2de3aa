// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/file/file_output.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "base/files.h"
#include "base/image_files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"

namespace veneer::projector {
namespace {

/// A frame together with the pixels that it borrows.
struct OwnedFrame {
  Image<Rgb16> codes;
  Image<Rgb32f> target;
  Frame frame;
};

class FileOutputTest : public ::testing::Test {
 protected:
  Result<std::unique_ptr<FileOutput>> open(const std::string& more = "") {
    VENEER_ASSIGN(
        TomlReader toml,
        TomlReader::parse(fmt::format("folder = '{}'\n{}", folder_.string(), more), "test"));
    VENEER_ASSIGN(std::unique_ptr<FileOutput> output, FileOutput::open(toml));
    VENEER_TRY(toml.finish());
    return output;
  }
  [[nodiscard]] std::vector<nlohmann::json> index() const {
    std::vector<nlohmann::json> lines;
    std::istringstream text(read_text(folder_ / "frames.jsonl").value());
    for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
    return lines;
  }
  [[nodiscard]] int count_files() const {
    return static_cast<int>(std::distance(std::filesystem::directory_iterator(folder_), {}));
  }

  TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path() / "frames";  // not there yet
};

OwnedFrame make_frame(std::uint64_t number, int bits, int width = 7, int height = 5) {
  OwnedFrame owned{Image<Rgb16>(width, height), Image<Rgb32f>(width, height), {}};
  Pcg32 random(number, static_cast<std::uint64_t>(bits));
  const std::uint32_t mask = (1U << static_cast<unsigned>(bits)) - 1;
  for (Rgb16& pixel : owned.codes.pixels()) {
    for (std::uint16_t& code : pixel) code = static_cast<std::uint16_t>(random.next() & mask);
  }
  for (Rgb32f& pixel : owned.target.pixels())
    pixel.setConstant(static_cast<float>(random.uniform()));
  owned.frame.number = number;
  owned.frame.bits = bits;
  owned.frame.display_time = Time{Duration{static_cast<Duration::rep>(1000 * number)}};
  return owned;
}

/// Views are taken last, since moving the images would leave them dangling.
const Frame& with_views(OwnedFrame& owned) {
  owned.frame.codes = std::as_const(owned.codes).view();
  owned.frame.target_xyz = std::as_const(owned.target).view();
  return owned.frame;
}

TEST_F(FileOutputTest, EightBitCodesAreWrittenAsTheyAre) {
  auto output = open();
  ASSERT_TRUE(output) << output.error().what;
  EXPECT_TRUE((*output)->wants_pixels(123));
  EXPECT_FALSE((*output)->wants_target(123));
  OwnedFrame owned = make_frame(123, 8);
  ASSERT_TRUE((*output)->present(with_views(owned)));
  ASSERT_TRUE((*output)->finish());
  const auto image = read_png(folder_ / "frame-000123.png");
  ASSERT_TRUE(image) << image.error().what;
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) {
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_EQ((*image)(x, y)[c], owned.codes(x, y)[c]) << x << ", " << y;
    }
  }
}

TEST_F(FileOutputTest, CodesOfAnyOtherDepthFillSixteenBitsAndComeBack) {
  for (const int bits : {1, 6, 10, 12, 16}) {
    auto output = open();
    ASSERT_TRUE(output);
    OwnedFrame owned = make_frame(1, bits, 64, 64);
    const auto highest = static_cast<std::uint16_t>((1U << static_cast<unsigned>(bits)) - 1);
    owned.codes(0, 0) = {0, highest, 0};
    ASSERT_TRUE((*output)->present(with_views(owned)));
    ASSERT_TRUE((*output)->finish());
    const auto image = read_png16(folder_ / "frame-000001.png");
    ASSERT_TRUE(image) << image.error().what;
    EXPECT_EQ((*image)(0, 0), (Rgb16{0, 65535, 0})) << bits;
    for (std::size_t i = 0; i < owned.codes.pixels().size(); ++i) {
      const Rgb16 code = owned.codes.pixels()[i];
      const Rgb16 value = image->pixels()[i];
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_EQ(value[c], std::lround(code[c] * 65535.0 / highest)) << bits;
        EXPECT_EQ(std::lround(value[c] * (highest / 65535.0)), code[c]) << bits;
      }
    }
  }
}

TEST_F(FileOutputTest, ReadsAViewWithPaddingRowByRow) {
  auto output = open();
  ASSERT_TRUE(output);
  OwnedFrame owned = make_frame(2, 8, 16, 5);
  Frame frame = with_views(owned);
  frame.codes = ImageView<const Rgb16>(frame.codes.data() + 3, 4, 5, 16);
  ASSERT_TRUE((*output)->present(frame));
  ASSERT_TRUE((*output)->finish());
  const auto image = read_png(folder_ / "frame-000002.png");
  ASSERT_TRUE(image);
  ASSERT_EQ(image->width(), 4);
  EXPECT_EQ((*image)(1, 4)[2], owned.codes(4, 4)[2]);
}

TEST_F(FileOutputTest, TheTargetIsWrittenWhereItWasAskedFor) {
  auto output = open("target = true");
  ASSERT_TRUE(output);
  EXPECT_TRUE((*output)->wants_target(9));
  OwnedFrame owned = make_frame(9, 8);
  ASSERT_TRUE((*output)->present(with_views(owned)));
  ASSERT_TRUE((*output)->finish());
  const auto target = read_exr_rgb(folder_ / "target-000009.exr", {"X", "Y", "Z"});
  ASSERT_TRUE(target) << target.error().what;
  EXPECT_EQ((*target)(3, 2), owned.target(3, 2));
  EXPECT_EQ(index().at(0).at("target"), "target-000009.exr");
}

TEST_F(FileOutputTest, AllFramesAreWrittenInOrderWhateverTheirNumber) {
  constexpr std::uint64_t kFrames = 40;  // many times the queue
  {
    auto output = open();
    ASSERT_TRUE(output);
    for (std::uint64_t n = 0; n < kFrames; ++n) {
      OwnedFrame owned = make_frame(n, 8, 200 + static_cast<int>(n % 3), 150);  // sizes may change
      ASSERT_TRUE((*output)->present(with_views(owned)));
      owned.codes = {};  // present() has made a copy
    }
    ASSERT_TRUE((*output)->finish());
    EXPECT_LE((*output)->waits(), kFrames);
  }
  const std::vector<nlohmann::json> lines = index();
  ASSERT_EQ(lines.size(), kFrames);
  for (std::uint64_t n = 0; n < kFrames; ++n) {
    EXPECT_EQ(lines[n].at("frame"), n);
    EXPECT_EQ(lines[n].at("display_time_ns"), 1000 * n);
    const auto image = read_png(folder_ / lines[n].at("file").get<std::string>());
    ASSERT_TRUE(image) << n;
    OwnedFrame expected = make_frame(n, 8, 200 + static_cast<int>(n % 3), 150);
    EXPECT_EQ((*image)(17, 31)[1], expected.codes(17, 31)[1]) << n;
  }
  EXPECT_EQ(count_files(), static_cast<int>(kFrames) + 1);  // nothing half-written is left
}

TEST_F(FileOutputTest, EveryNthFrameIsWrittenAndTheOthersNeedNoPixels) {
  auto output = open("every = 4\ntarget = true");
  ASSERT_TRUE(output);
  for (std::uint64_t n = 0; n < 10; ++n) {
    EXPECT_EQ((*output)->wants_pixels(n), n % 4 == 0) << n;
    EXPECT_EQ((*output)->wants_target(n), n % 4 == 0) << n;
    OwnedFrame owned = make_frame(n, 8);
    Frame frame = with_views(owned);
    if (!(*output)->wants_pixels(n)) frame.codes = {};
    if (!(*output)->wants_target(n)) frame.target_xyz = {};
    ASSERT_TRUE((*output)->present(frame)) << n;
  }
  ASSERT_TRUE((*output)->finish());
  const std::vector<nlohmann::json> lines = index();
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[2].at("file"), "frame-000008.png");
  EXPECT_EQ(count_files(), 7);  // three of each kind and the index
}

TEST_F(FileOutputTest, TheIndexOfAnEarlierRunStaysUntilAFrameIsWritten) {
  const std::string earlier = "{\"frame\":7}\n";
  std::filesystem::create_directories(folder_);
  ASSERT_TRUE(write_text(folder_ / "frames.jsonl", earlier));
  {
    auto output = open("every = 2");
    ASSERT_TRUE(output) << output.error().what;
    Frame unwanted;
    unwanted.number = 1;
    ASSERT_TRUE((*output)->present(unwanted));
    ASSERT_TRUE((*output)->finish());
  }
  EXPECT_EQ(read_text(folder_ / "frames.jsonl").value(), earlier);
  auto output = open("every = 2");
  ASSERT_TRUE(output);
  OwnedFrame owned = make_frame(2, 8);
  ASSERT_TRUE((*output)->present(with_views(owned)));
  ASSERT_TRUE((*output)->finish());
  const std::vector<nlohmann::json> lines = index();
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].at("frame"), 2);
}

TEST_F(FileOutputTest, WritesWhatIsQueuedWhenItIsDestroyed) {
  {
    auto output = open();
    ASSERT_TRUE(output);
    for (std::uint64_t n = 0; n < 4; ++n) {
      OwnedFrame owned = make_frame(n, 8);
      ASSERT_TRUE((*output)->present(with_views(owned)));
    }
  }
  EXPECT_EQ(index().size(), 4U);
}

TEST_F(FileOutputTest, AnErrorOfTheDiskSurfacesAndStays) {
  auto output = open();
  ASSERT_TRUE(output);
  // A file in place of the folder: whoever runs this, it cannot be written into.
  std::filesystem::remove_all(folder_);
  ASSERT_TRUE(write_text(folder_, "in the way"));
  OwnedFrame owned = make_frame(1, 8);
  ASSERT_TRUE((*output)->present(with_views(owned)));  // queued
  const Status finished = (*output)->finish();
  ASSERT_FALSE(finished);
  EXPECT_EQ(finished.error().code, Errc::kIo);
  const Status next = (*output)->present(with_views(owned));
  ASSERT_FALSE(next);
  EXPECT_EQ(next.error().what, finished.error().what);
}

TEST_F(FileOutputTest, AnErrorReachesAFrameLoopThatNeverFinishes) {
  auto output = open();
  ASSERT_TRUE(output);
  std::filesystem::remove_all(folder_);
  ASSERT_TRUE(write_text(folder_, "in the way"));
  Status status;
  // The queue holds 4 frames, so that the error is known by the 6th at the latest.
  for (std::uint64_t n = 0; n < 6 && status; ++n) {
    OwnedFrame owned = make_frame(n, 8);
    status = (*output)->present(with_views(owned));
  }
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kIo);
}

TEST_F(FileOutputTest, RefusesAFolderThatIsAFile) {
  ASSERT_TRUE(write_text(folder_, "a file"));
  const auto output = open();
  ASSERT_FALSE(output);
  EXPECT_EQ(output.error().code, Errc::kIo);
  EXPECT_NE(output.error().what.find(folder_.string()), std::string::npos);
}

TEST_F(FileOutputTest, RefusesBadOptions) {
  for (const char* bad : {"every = 0", "every = -1", "target = 1", "fps = 60"}) {
    const auto output = open(bad);
    ASSERT_FALSE(output) << bad;
    EXPECT_EQ(output.error().code, Errc::kInvalidOption) << bad;
  }
  TomlReader empty = TomlReader::parse("", "test").value();
  EXPECT_EQ(FileOutput::open(empty).error().code, Errc::kInvalidOption);
}

TEST_F(FileOutputTest, RefusesFramesThatItCannotWrite) {
  auto output = open("target = true");
  ASSERT_TRUE(output);
  OwnedFrame owned = make_frame(1, 8);
  Frame frame = with_views(owned);
  frame.target_xyz = {};
  EXPECT_EQ((*output)->present(frame).error().code, Errc::kBadFormat);
  frame = with_views(owned);
  frame.codes = {};
  EXPECT_EQ((*output)->present(frame).error().code, Errc::kBadFormat);
  EXPECT_TRUE((*output)->finish());  // nothing was queued
}

TEST_F(FileOutputTest, RefusesCodesThatDoNotFitTheirBits) {
  for (const int bits : {-1, 0, 7, 17}) {
    auto output = open();
    ASSERT_TRUE(output);
    OwnedFrame owned = make_frame(1, 8);
    owned.codes(0, 0) = {200, 0, 0};
    owned.frame.bits = bits;
    ASSERT_TRUE((*output)->present(with_views(owned)));
    EXPECT_EQ((*output)->finish().error().code, Errc::kBadFormat) << bits;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "frame-000001.png"));
  }
}

}  // namespace
}  // namespace veneer::projector
