// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/polhemus_protocol.h"

#include <gtest/gtest.h>

#include <limits>
#include <string_view>

#include "base/random.h"

namespace veneer::tracking {
namespace {

using Bytes = std::vector<std::byte>;

PolhemusFrame frame_of(std::uint32_t count, std::uint8_t station = 1) {
  PolhemusFrame frame;
  frame.station = station;
  frame.count = count;
  frame.milliseconds = count * 1000 / 240;
  frame.distortion = -7;
  frame.position_cm = {static_cast<float>(count), -2.5F, 100.25F};
  frame.rotation = Eigen::Quaternionf(0.5F, 0.5F, -0.5F, 0.5F);
  return frame;
}

void append(Bytes& bytes,
            const PolhemusFrame& frame,
            PolhemusModel model = PolhemusModel::kLiberty) {
  const auto encoded = encode(frame, model);
  bytes.insert(bytes.end(), encoded.begin(), encoded.end());
}

void append(Bytes& bytes, std::string_view text) {
  for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
}

std::vector<RawSample> feed(PolhemusProtocol& protocol, std::span<const std::byte> bytes) {
  std::vector<RawSample> samples;
  Bytes reply;
  protocol.feed(bytes, samples, reply);
  EXPECT_TRUE(reply.empty());
  return samples;
}

std::vector<std::uint64_t> counts(const std::vector<RawSample>& samples) {
  std::vector<std::uint64_t> result;
  for (const RawSample& sample : samples) result.push_back(*sample.sequence);
  return result;
}

TEST(PolhemusFrame, HasTheLayoutOfTheDocument) {
  PolhemusFrame frame = frame_of(0x01020304);
  frame.station = 3;
  frame.error = 'I';
  frame.position_cm.x() = 1.0F;
  const auto bytes = encode(frame, PolhemusModel::kPatriot);
  const auto at = [&bytes](std::size_t i) { return std::to_integer<int>(bytes[i]); };
  EXPECT_EQ(at(0), 'P');
  EXPECT_EQ(at(1), 'A');
  EXPECT_EQ(at(2), 3);
  EXPECT_EQ(at(3), 'C');
  EXPECT_EQ(at(4), 'I');
  EXPECT_EQ(at(6), 40);
  EXPECT_EQ(at(7), 0);
  EXPECT_EQ(at(12), 4);  // little-endian
  EXPECT_EQ(at(15), 1);
  EXPECT_EQ(at(20), 0);  // 1.0F is 00 00 80 3F
  EXPECT_EQ(at(22), 0x80);
  EXPECT_EQ(at(23), 0x3F);
  EXPECT_EQ(at(35), 0x3F);  // w is the first of the quaternion: 0.5F is 00 00 00 3F
}

TEST(PolhemusProtocol, SaysWhatTheFrameSays) {
  PolhemusProtocol protocol(PolhemusModel::kLiberty);
  Bytes bytes;
  append(bytes, frame_of(12345, 16));
  const auto samples = feed(protocol, bytes);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].sensor, 16);
  EXPECT_EQ(samples[0].ticks, 12345U);
  EXPECT_EQ(samples[0].sequence, 12345U);
  EXPECT_TRUE(samples[0].position_m.isApprox(Eigen::Vector3d(123.45, -0.025, 1.0025), 1e-12));
  EXPECT_EQ(samples[0].rotation.coeffs(), Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5).coeffs());
  EXPECT_FALSE(samples[0].suspect);
  EXPECT_EQ(protocol.counters().skipped_bytes, 0U);
}

TEST(PolhemusProtocol, EachModelIsTimedByWhatIsKnownOfIt) {
  Bytes bytes;
  append(bytes, frame_of(480));
  PolhemusProtocol liberty(PolhemusModel::kLiberty);
  const auto fine = feed(liberty, bytes);
  ASSERT_EQ(fine.size(), 1U);
  EXPECT_DOUBLE_EQ(static_cast<double>(*fine[0].ticks) * liberty.clock()->seconds_per_tick, 2);
  // Of a PATRIOT the rate of its frames is not relied on.
  PolhemusFrame frame = frame_of(120);
  frame.milliseconds = 2000;
  bytes.clear();
  append(bytes, frame, PolhemusModel::kPatriot);
  PolhemusProtocol patriot(PolhemusModel::kPatriot);
  const auto coarse = feed(patriot, bytes);
  ASSERT_EQ(coarse.size(), 1U);
  EXPECT_DOUBLE_EQ(static_cast<double>(*coarse[0].ticks) * patriot.clock()->seconds_per_tick, 2);
  EXPECT_EQ(coarse[0].sequence, 120U);
}

TEST(PolhemusProtocol, AnErrorLetterMakesASampleSuspect) {
  PolhemusProtocol protocol(PolhemusModel::kLiberty);
  PolhemusFrame frame = frame_of(1);
  frame.error = 'a';
  Bytes bytes;
  append(bytes, frame);
  const auto samples = feed(protocol, bytes);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_TRUE(samples[0].suspect);
}

/// Frames, garbage, false beginnings, text: what a cable gives on a bad day.
Bytes bad_day() {
  Pcg32 random(5);
  Bytes bytes;
  for (std::uint32_t i = 0; i < 40; ++i) {
    if (i % 5 == 1) append(bytes, "LY");
    if (i % 7 == 2) append(bytes, "L");
    if (i % 6 == 3) {
      for (std::uint32_t n = random.next() % 60; n > 0; --n)
        bytes.push_back(static_cast<std::byte>(random.next()));
    }
    if (i % 11 == 4) append(bytes, "0 1.25 -7.5 3.125 90.0 0.0 12.5\r\n");
    PolhemusFrame frame = frame_of(i, static_cast<std::uint8_t>(1 + i % 4));
    if (i % 9 == 5) frame.position_cm.x() = std::numeric_limits<float>::quiet_NaN();
    append(bytes, frame);
  }
  return bytes;
}

void expect_same(const std::vector<RawSample>& a, const std::vector<RawSample>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].sensor, b[i].sensor);
    EXPECT_EQ(a[i].sequence, b[i].sequence);
    const bool nan = std::isnan(a[i].position_m.x()) && std::isnan(b[i].position_m.x());
    EXPECT_TRUE(nan || a[i].position_m == b[i].position_m);
  }
}

TEST(PolhemusProtocol, AnyCutOfTheBytesGivesTheSameSamples) {
  const Bytes bytes = bad_day();
  PolhemusProtocol whole(PolhemusModel::kLiberty);
  const auto expected = feed(whole, bytes);
  EXPECT_EQ(expected.size(), 40U);
  const std::span<const std::byte> all = bytes;
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    PolhemusProtocol protocol(PolhemusModel::kLiberty);
    auto samples = feed(protocol, all.first(cut));
    const auto rest = feed(protocol, all.subspan(cut));
    samples.insert(samples.end(), rest.begin(), rest.end());
    expect_same(samples, expected);
    EXPECT_EQ(protocol.counters().skipped_bytes, whole.counters().skipped_bytes) << cut;
    EXPECT_EQ(protocol.counters().bad_frames, whole.counters().bad_frames) << cut;
    EXPECT_EQ(protocol.wants_restart(), whole.wants_restart()) << cut;
  }
  for (const std::size_t piece :
       {std::size_t{1}, std::size_t{7}, std::size_t{47}, std::size_t{120}}) {
    PolhemusProtocol protocol(PolhemusModel::kLiberty);
    std::vector<RawSample> samples;
    for (std::size_t at = 0; at < all.size(); at += piece) {
      const auto some = feed(protocol, all.subspan(at, std::min(piece, all.size() - at)));
      samples.insert(samples.end(), some.begin(), some.end());
    }
    expect_same(samples, expected);
  }
}

TEST(PolhemusProtocol, AFrameIsNeverLostToAFalseBeginning) {
  for (const std::string_view before : {"L",
                                        "LY",
                                        "LYL",
                                        "LY\x01",
                                        "LY\x01"
                                        "C",
                                        "LY\x01"
                                        "C ",
                                        "LLLLLY\x10P"}) {
    PolhemusProtocol protocol(PolhemusModel::kLiberty);
    Bytes bytes;
    append(bytes, before);
    append(bytes, frame_of(77));
    EXPECT_EQ(counts(feed(protocol, bytes)), std::vector<std::uint64_t>{77}) << before;
    EXPECT_EQ(protocol.counters().skipped_bytes, before.size());
  }
}

TEST(PolhemusProtocol, LettersInsideAFloatBeginNoFrame) {
  PolhemusProtocol protocol(PolhemusModel::kLiberty);
  const std::uint8_t letters[] = {'L', 'Y', 1, 'C'};
  PolhemusFrame frame = frame_of(5);
  std::memcpy(&frame.position_cm.y(), letters, 4);
  Bytes bytes;
  append(bytes, frame);
  append(bytes, frame_of(6));
  // Begun in the middle of the first, as after an overflow.
  const std::span<const std::byte> all = bytes;
  EXPECT_EQ(counts(feed(protocol, all.subspan(3))), std::vector<std::uint64_t>{6});
}

TEST(PolhemusProtocol, WrongStationsSizesAndModelsAreRefused) {
  for (const auto& [at, value] : {std::pair{2, 0}, {2, 17}, {3, 'Q'}, {6, 41}, {7, 1}}) {
    PolhemusProtocol protocol(PolhemusModel::kLiberty);
    Bytes bytes;
    append(bytes, frame_of(1));
    bytes[static_cast<std::size_t>(at)] = static_cast<std::byte>(value);
    append(bytes, frame_of(2));
    EXPECT_EQ(counts(feed(protocol, bytes)), std::vector<std::uint64_t>{2}) << at;
    EXPECT_EQ(protocol.counters().bad_frames, 1U);
    EXPECT_EQ(protocol.counters().skipped_bytes, PolhemusFrame::kBytes);
  }
  PolhemusProtocol patriot(PolhemusModel::kPatriot);
  Bytes bytes;
  append(bytes, frame_of(1));
  EXPECT_TRUE(feed(patriot, bytes).empty());
}

TEST(PolhemusProtocol, TextSaysThatTheDeviceHasForgotten) {
  PolhemusProtocol protocol(PolhemusModel::kLiberty);
  Bytes text;
  append(text, "01  12.31  -4.22  30.00  12.2 3.2 1.2\r\n");
  feed(protocol, text);
  EXPECT_TRUE(protocol.wants_restart());
  protocol.reset();
  EXPECT_FALSE(protocol.wants_restart());
  // A true stream has none of it, whatever stands in its numbers.
  Bytes bytes;
  PolhemusFrame frame = frame_of(1);
  std::memset(frame.position_cm.data(), 'A', sizeof(float) * 3);
  std::memset(frame.rotation.coeffs().data(), 'B', sizeof(float) * 4);
  append(bytes, frame);
  EXPECT_EQ(feed(protocol, bytes).size(), 1U);
  EXPECT_FALSE(protocol.wants_restart());
}

TEST(PolhemusProtocol, ResetForgetsHalfAFrame) {
  PolhemusProtocol protocol(PolhemusModel::kLiberty);
  Bytes bytes;
  append(bytes, frame_of(1));
  const std::span<const std::byte> all = bytes;
  feed(protocol, all.first(20));
  protocol.reset();
  EXPECT_EQ(counts(feed(protocol, bytes)), std::vector<std::uint64_t>{1});
}

TEST(PolhemusProtocol, StartAgreesOnWhatTheFrameHolds) {
  const auto commands = PolhemusProtocol(PolhemusModel::kLiberty).start();
  ASSERT_FALSE(commands.empty());
  std::string all;
  Duration pauses{};
  for (const Command& command : commands) {
    for (const std::byte byte : command.bytes) all.push_back(std::to_integer<char>(byte));
    pauses += command.pause;
  }
  EXPECT_NE(all.find("F1\r"), std::string::npos);
  EXPECT_NE(all.find("O*,8,9,11,3,7\r"), std::string::npos);
  EXPECT_TRUE(all.ends_with("C\r"));
  EXPECT_LT(pauses, std::chrono::seconds(1));  // a replug must not take long
}

}  // namespace
}  // namespace veneer::tracking
