// SPDX-License-Identifier: Apache-2.0
#include "tracking/recording.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"

namespace veneer::tracking {
namespace {

const std::string kHeader = "{\"format\":\"veneer-poses\",\"version\":1}\n";
const std::string kLine = "{\"t_ns\":5,\"body\":1,\"seq\":2,\"p\":[1,2,3],\"q\":[1,0,0,0]}\n";

class RecordingTest : public ::testing::Test {
 protected:
  struct Contents {
    std::vector<PoseSample> samples;
    bool truncated = false;
  };
  [[nodiscard]] Result<Contents> read() const {
    Contents contents;
    VENEER_ASSIGN(PoseRecordingReader reader, PoseRecordingReader::open(path_));
    while (true) {
      VENEER_ASSIGN(const std::optional<PoseSample> sample, reader.next());
      if (!sample) break;
      contents.samples.push_back(*sample);
    }
    contents.truncated = reader.truncated();
    return contents;
  }
  [[nodiscard]] Result<Contents> read(const std::string& text) const {
    EXPECT_TRUE(write_text(path_, text));
    return read();
  }

  TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path() / "poses";  // not there yet
  std::filesystem::path path_ = folder_ / "poses.jsonl";
};

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

TEST_F(RecordingTest, FiniteNumbersComeBackBitForBit) {
  using Limits = std::numeric_limits<double>;
  const std::vector<double> odd{
      -0.0, 0.1, Limits::denorm_min(), Limits::max(), 1e16, 1e22, 1.0 / 3, 123456789};
  Pcg32 random(1);
  const auto number = [&] {
    return random.uniform() < 0.3 ? odd[random.next() % odd.size()] : random.normal();
  };
  std::vector<PoseSample> written;
  {
    auto recorder = PoseRecorder::create(path_);
    ASSERT_TRUE(recorder) << recorder.error().what;
    for (int i = 0; i < 500; ++i) {
      PoseSample sample;
      sample.body = static_cast<BodyId>(random.next());
      sample.time = Time{Duration{static_cast<Duration::rep>(random.next()) * random.next()}};
      sample.sequence = std::numeric_limits<std::uint64_t>::max() - random.next();
      sample.world_from_body = {Eigen::Quaterniond(number(), number(), number(), number()),
                                Eigen::Vector3d(number(), number(), number())};
      ASSERT_TRUE(recorder->write(sample));
      written.push_back(sample);
    }
  }
  const auto contents = read();
  ASSERT_TRUE(contents) << contents.error().what;
  EXPECT_FALSE(contents->truncated);
  ASSERT_EQ(contents->samples.size(), written.size());
  for (std::size_t i = 0; i < written.size(); ++i) {
    const PoseSample& a = written[i];
    const PoseSample& b = contents->samples[i];
    EXPECT_EQ(a.body, b.body);
    EXPECT_EQ(a.time, b.time);
    EXPECT_EQ(a.sequence, b.sequence);
    for (int k = 0; k < 3; ++k) {
      EXPECT_TRUE(same_bits(a.world_from_body.translation[k], b.world_from_body.translation[k]))
          << i;
    }
    for (int k = 0; k < 4; ++k) {
      EXPECT_TRUE(
          same_bits(a.world_from_body.rotation.coeffs()[k], b.world_from_body.rotation.coeffs()[k]))
          << i;
    }
  }
}

TEST_F(RecordingTest, NumbersThatAreNoneComeBackAsNan) {
  {
    auto recorder = PoseRecorder::create(path_);
    ASSERT_TRUE(recorder);
    PoseSample sample;
    sample.world_from_body.translation = {1, HUGE_VAL, std::nan("")};
    ASSERT_TRUE(recorder->write(sample));
  }
  const auto contents = read();
  ASSERT_TRUE(contents) << contents.error().what;
  const Eigen::Vector3d p = contents->samples.at(0).world_from_body.translation;
  EXPECT_EQ(p.x(), 1);
  EXPECT_TRUE(std::isnan(p.y()) && std::isnan(p.z()));
}

TEST_F(RecordingTest, EverySampleIsInTheFileAtOnce) {
  auto recorder = PoseRecorder::create(path_);
  ASSERT_TRUE(recorder);
  ASSERT_TRUE(
      recorder->write({}));  // the recorder is still open, as when the program is killed now
  const auto contents = read();
  ASSERT_TRUE(contents);
  EXPECT_EQ(contents->samples.size(), 1U);
}

TEST_F(RecordingTest, ALastLineCutAnywhereIsReportedAndLeftOut) {
  for (std::size_t length = 0; length < kLine.size(); ++length) {
    const auto contents = read(kHeader + kLine + kLine.substr(0, length));
    ASSERT_TRUE(contents) << length << ": " << contents.error().what;
    const bool whole = length == kLine.size() - 1;  // only the line end is missing
    EXPECT_EQ(contents->samples.size(), whole ? 2U : 1U) << length;
    EXPECT_EQ(contents->truncated, !whole && length > 0) << length;
  }
}

TEST_F(RecordingTest, NamesTheBadLine) {
  for (const std::string& bad :
       {std::string("{\"t_ns\":5,\"bo\n"),
        std::string("\n"),
        std::string("[]\n"),
        std::string("{}\n"),
        std::string("{\"t_ns\":5.5,\"body\":1,\"seq\":2,\"p\":[1,2,3],\"q\":[1,0,0,0]}\n"),
        std::string(
            "{\"t_ns\":18446744073709551615,\"body\":1,\"seq\":2,\"p\":[1,2,3],\"q\":[1,0,0,0]}\n"),
        std::string(
            "{\"t_ns\":5,\"body\":18446744073709551615,\"seq\":2,\"p\":[1,2,3],\"q\":[1,0,0,0]}\n"),
        std::string("{\"t_ns\":5,\"body\":1,\"seq\":-2,\"p\":[1,2,3],\"q\":[1,0,0,0]}\n"),
        std::string("{\"t_ns\":5,\"body\":1,\"seq\":2,\"p\":[1,2],\"q\":[1,0,0,0]}\n"),
        std::string("{\"t_ns\":5,\"body\":1,\"seq\":2,\"p\":[1,2,3],\"q\":[1,0,0,\"0\"]}\n"),
        std::string("\0\xff\n", 3)}) {
    const auto contents = read(kHeader + kLine + bad + kLine);
    ASSERT_FALSE(contents) << bad;
    EXPECT_EQ(contents.error().code, Errc::kBadFormat) << bad;
    EXPECT_NE(contents.error().what.find("line 3"), std::string::npos) << contents.error().what;
  }
}

TEST_F(RecordingTest, RefusesWhatIsNoRecording) {
  EXPECT_EQ(read().error().code, Errc::kNotFound);
  for (const std::string& text : {std::string(),
                                  std::string("\n"),
                                  std::string("{\"format\":\"veneer-po"),
                                  kLine,
                                  std::string("[1]\n"),
                                  std::string("{\"format\":7,\"version\":1}\n"),
                                  std::string("{\"format\":\"veneer-poses\"}\n"),
                                  std::string("{\"format\":\"veneer-poses\",\"version\":2}\n")}) {
    const auto contents = read(text);
    ASSERT_FALSE(contents) << text;
    EXPECT_EQ(contents.error().code, Errc::kBadFormat) << text;
  }
  EXPECT_EQ(PoseRecordingReader::open(folder_).error().code, Errc::kNotFound);
}

TEST_F(RecordingTest, SaysWhereItCannotWrite) {
  ASSERT_TRUE(write_text(path_, "a file"));
  const auto recorder =
      PoseRecorder::create(path_ / "poses.jsonl");  // a file where a folder should be
  ASSERT_FALSE(recorder);
  EXPECT_EQ(recorder.error().code, Errc::kIo);
  if (std::filesystem::exists("/dev/full")) {
    EXPECT_EQ(PoseRecorder::create("/dev/full").error().code, Errc::kIo);
  }
}

}  // namespace
}  // namespace veneer::tracking
