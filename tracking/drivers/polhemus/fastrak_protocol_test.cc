// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/fastrak_protocol.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <string_view>

#include "base/random.h"
#include "tracking/testing/protocol_laws.h"

namespace veneer::tracking {
namespace {

using Bytes = std::vector<std::byte>;

std::unique_ptr<Protocol> make() { return std::make_unique<FastrakProtocol>(); }

FastrakRecord record_of(float x_cm, int station = 1) {
  FastrakRecord record;
  record.station = station;
  record.position_cm = {x_cm, -2.5F, 100.25F};
  record.rotation = Eigen::Quaternionf(0.5F, 0.5F, -0.5F, 0.5F);
  return record;
}

void append(Bytes& bytes, const FastrakRecord& record) {
  const auto encoded = encode(record);
  bytes.insert(bytes.end(), encoded.begin(), encoded.end());
}

void append(Bytes& bytes, std::string_view text) {
  for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
}

Understanding understood(const Bytes& bytes) {
  const std::vector<std::span<const std::byte>> pieces{bytes};
  FastrakProtocol protocol;
  return understand(protocol, pieces);
}

TEST(FastrakRecord, HasTheLayoutOfTheDocument) {
  FastrakRecord record = record_of(1.0F, 3);
  record.error = 'I';
  const auto bytes = encode(record);
  const auto at = [&bytes](std::size_t i) { return std::to_integer<int>(bytes[i]); };
  ASSERT_EQ(bytes.size(), 32U);
  EXPECT_EQ(at(0), '0');
  EXPECT_EQ(at(1), '3');
  EXPECT_EQ(at(2), 'I');
  EXPECT_EQ(at(3), 0);  // 1.0F is 00 00 80 3F
  EXPECT_EQ(at(5), 0x80);
  EXPECT_EQ(at(6), 0x3F);
  EXPECT_EQ(at(18), 0x3F);  // w is the first of the quaternion: 0.5F is 00 00 00 3F
  EXPECT_EQ(at(31), ' ');
}

TEST(FastrakProtocol, SaysWhatTheRecordSays) {
  Bytes bytes;
  append(bytes, record_of(12345, 4));
  const Understanding all = understood(bytes);
  ASSERT_EQ(all.samples.size(), 1U);
  const RawSample& sample = all.samples[0];
  EXPECT_EQ(sample.sensor, 4);
  EXPECT_FALSE(sample.ticks || sample.sequence) << "it has neither";
  EXPECT_TRUE(sample.position_m.isApprox(Eigen::Vector3d(123.45, -0.025, 1.0025), 1e-12));
  EXPECT_EQ(sample.rotation.coeffs(), Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5).coeffs());
  EXPECT_FALSE(sample.suspect);
  EXPECT_EQ(all.counters.skipped_bytes, 0U);
}

TEST(FastrakProtocol, ALetterMakesASampleSuspect) {
  for (const char letter : {'a', 'I', 'z'}) {
    FastrakRecord record = record_of(1);
    record.error = letter;
    Bytes bytes;
    append(bytes, record);
    const Understanding all = understood(bytes);
    ASSERT_EQ(all.samples.size(), 1U) << letter;
    EXPECT_TRUE(all.samples[0].suspect) << letter;
  }
}

TEST(FastrakProtocol, ARecordIsNeverLostToAFalseBeginning) {
  for (const std::string_view before :
       {"0", "01", "010", "01 ", "0001", "04x", "01 01 01 ", "02a02a0"}) {
    Bytes bytes;
    append(bytes, before);
    append(bytes, record_of(7));
    const Understanding all = understood(bytes);
    ASSERT_EQ(all.samples.size(), 1U) << before;
    EXPECT_NEAR(all.samples[0].position_m.x(), 0.07, 1e-9);
    EXPECT_EQ(all.counters.skipped_bytes, before.size());
  }
}

TEST(FastrakProtocol, WhatIsNoRecordIsRefusedAndTheNextOneIsNot) {
  for (const auto& [at, value] : {std::pair{0, '1'}, {1, '0'}, {1, '5'}, {2, '3'}, {31, 'x'}}) {
    Bytes bytes;
    append(bytes, record_of(1));
    bytes[static_cast<std::size_t>(at)] = static_cast<std::byte>(value);
    append(bytes, record_of(2));
    const Understanding all = understood(bytes);
    ASSERT_EQ(all.samples.size(), 1U) << at;
    EXPECT_NEAR(all.samples[0].position_m.x(), 0.02, 1e-9);
    EXPECT_EQ(all.counters.skipped_bytes, FastrakRecord::kBytes);
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const float w : {nan, std::numeric_limits<float>::infinity(), -1e30F, 0.0F, 1.3F}) {
    FastrakRecord record = record_of(1);
    record.rotation = Eigen::Quaternionf(w, 0, 0, 0);
    Bytes bytes;
    append(bytes, record);
    append(bytes, record_of(2));
    const Understanding all = understood(bytes);
    EXPECT_EQ(all.samples.size(), 1U) << w;
    EXPECT_EQ(all.counters.bad_frames, 1U) << w;
  }
}

TEST(FastrakProtocol, TextIsNoRecordAndSaysThatTheDeviceHasForgotten) {
  // ASCII records begin as the binary ones do; shifted, so that any byte of them ends one.
  std::string text;
  for (int i = 0; i < 40; ++i) {
    text += fmt::format("0{} {:7.2f}{:7.2f}{:7.2f} {:.4f} 0.5000-0.5000 0.5000{}\r\n",
                        1 + i % 4,
                        10.0 + i,
                        -4.22,
                        30.0,
                        0.5,
                        std::string(static_cast<std::size_t>(i % 7), ' '));
  }
  Bytes bytes;
  append(bytes, text);
  const Understanding all = understood(bytes);
  EXPECT_TRUE(all.samples.empty());
  EXPECT_TRUE(all.wants_restart);

  Bytes stream;
  for (int i = 0; i < 100; ++i) append(stream, record_of(static_cast<float>(i)));
  const Understanding calm = understood(stream);
  EXPECT_EQ(calm.samples.size(), 100U);
  EXPECT_FALSE(calm.wants_restart);
}

TEST(FastrakProtocol, TheLawsHoldOnABadDay) {
  Pcg32 random(5);
  Bytes bytes;
  for (int i = 0; i < 40; ++i) {
    if (i % 5 == 1) append(bytes, "01 ");
    if (i % 6 == 3) {
      for (std::uint32_t n = random.next() % 60; n > 0; --n)
        bytes.push_back(static_cast<std::byte>(random.next()));
    }
    if (i % 11 == 4) append(bytes, "01   1.25  -7.50  3.125 90.0 0.0 12.5\r\n");
    append(bytes, record_of(static_cast<float>(i), 1 + i % 4));
  }
  EXPECT_EQ(understood(bytes).samples.size(), 40U);
  const std::vector<std::span<const std::byte>> whole{bytes};
  for (std::size_t cut = 0; cut < bytes.size(); ++cut)
    ASSERT_EQ(broken_law(&make, Framing::kStream, whole, cut), "") << cut;
  for (int i = 0; i < 1000; ++i) {
    Bytes changed = bytes;
    for (std::uint32_t n = 1 + random.next() % 20; n > 0; --n)
      changed[random.next() % changed.size()] = static_cast<std::byte>(random.next());
    const std::vector<std::span<const std::byte>> pieces{changed};
    ASSERT_EQ(broken_law(&make, Framing::kStream, pieces, random.next()), "") << i;
  }
}

TEST(FastrakProtocol, StartAgreesOnWhatTheRecordHolds) {
  std::string all;
  Duration pauses{};
  for (const Command& command : FastrakProtocol().start()) {
    for (const std::byte byte : command.bytes) all.push_back(std::to_integer<char>(byte));
    pauses += command.pause;
  }
  EXPECT_TRUE(all.starts_with("cfu")) << "stop, binary, centimetres; the case matters";
  for (int station = 1; station <= FastrakRecord::kStations; ++station)
    EXPECT_NE(all.find(fmt::format("O{},2,11,0\r", station)), std::string::npos);
  EXPECT_TRUE(all.ends_with("C"));
  EXPECT_LT(pauses, std::chrono::seconds(1));  // a replug must not take long
}

}  // namespace
}  // namespace veneer::tracking
