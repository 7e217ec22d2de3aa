// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/osvr_hdk/osvr_hdk_protocol.h"

#include <gtest/gtest.h>

#include <cstdint>

#include "base/random.h"

namespace veneer::tracking {
namespace {

using Bytes = std::vector<std::byte>;

Bytes report(std::size_t size, int version, int sequence, const Eigen::Vector4d& xyzw) {
  Bytes bytes(size);
  bytes[0] = static_cast<std::byte>(version);
  bytes[1] = static_cast<std::byte>(sequence);
  for (int i = 0; i < 4; ++i) {
    const int value = static_cast<int>(xyzw[i] * 16384);
    const auto at = static_cast<std::size_t>(2 + 2 * i);
    bytes[at] = static_cast<std::byte>(value & 0xFF);
    bytes[at + 1] = static_cast<std::byte>((value >> 8) & 0xFF);
  }
  return bytes;
}

std::vector<RawSample> feed(OsvrHdkProtocol& protocol, const Bytes& bytes) {
  std::vector<RawSample> samples;
  Bytes reply;
  protocol.feed(bytes, samples, reply);
  EXPECT_TRUE(reply.empty());
  return samples;
}

const Eigen::Vector4d kTurned(0.5, -0.5, 0.25, -0.75);

TEST(OsvrHdkProtocol, AReportOfEitherLengthAndAnyVersionSaysWhereItLooks) {
  const Eigen::Vector3d place(1, 2, 3);
  OsvrHdkProtocol protocol(place);
  for (const std::size_t size : {std::size_t{16}, std::size_t{32}}) {
    for (const int version : {0x01, 0x02, 0x03, 0x13, 0x33}) {  // with bits of the video, too
      const auto samples = feed(protocol, report(size, version, 200, kTurned));
      ASSERT_EQ(samples.size(), 1U);
      EXPECT_EQ(samples[0].sensor, 1);
      EXPECT_EQ(samples[0].sequence, 200U);
      EXPECT_FALSE(samples[0].ticks);
      EXPECT_EQ(samples[0].position_m, place);
      EXPECT_EQ(samples[0].rotation.coeffs(), kTurned);
    }
  }
  EXPECT_EQ(protocol.counters().bad_frames, 0U);
}

TEST(OsvrHdkProtocol, OtherLengthsAndVersionsAreDroppedAndCounted) {
  OsvrHdkProtocol protocol;
  std::uint64_t dropped = 0;
  for (std::size_t size = 0; size < 80; ++size) {
    if (size == 16 || size == 32) continue;
    Bytes bytes = report(80, 1, 0, kTurned);
    bytes.resize(size);
    EXPECT_TRUE(feed(protocol, bytes).empty()) << size;
    EXPECT_EQ(protocol.counters().bad_frames, ++dropped);
  }
  for (int version = 0; version < 16; ++version) {
    const bool known = version >= 1 && version <= 3;
    EXPECT_EQ(feed(protocol, report(16, version, 0, kTurned)).size(), known ? 1U : 0U);
    if (!known) ++dropped;
    EXPECT_EQ(protocol.counters().bad_frames, dropped);
  }
}

TEST(OsvrHdkProtocol, AnyBytesAreSurvived) {
  Pcg32 random(13);
  OsvrHdkProtocol protocol;
  for (int i = 0; i < 2000; ++i) {
    Bytes bytes(i % 2 == 0 ? 16 : static_cast<std::size_t>(random.uniform() * 80));
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random.uniform() * 256);
    for (const RawSample& sample : feed(protocol, bytes)) {
      EXPECT_TRUE(sample.rotation.coeffs().allFinite());
      EXPECT_LE(*sample.sequence, 255U);
    }
  }
}

}  // namespace
}  // namespace veneer::tracking
