// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/razer_hydra/razer_hydra_protocol.h"

#include <gtest/gtest.h>

#include <array>

#include "base/random.h"

namespace veneer::tracking {
namespace {

using Bytes = std::vector<std::byte>;

void put(Bytes& bytes, std::size_t at, int value) {
  bytes[at] = static_cast<std::byte>(value & 0xFF);
  bytes[at + 1] = static_cast<std::byte>((value >> 8) & 0xFF);
}

/// @param block  x, y, z, w, x, y, z as the device counts them.
Bytes report(const std::array<int, 7>& first, const std::array<int, 7>& second) {
  Bytes bytes(RazerHydraProtocol::kReportBytes);
  for (std::size_t i = 0; i < 7; ++i) {
    put(bytes, 8 + 2 * i, first[i]);
    put(bytes, 30 + 2 * i, second[i]);
  }
  return bytes;
}

constexpr std::array<int, 7> kStill{100, 200, -300, 32767, 0, 0, 0};

std::vector<RawSample> feed(RazerHydraProtocol& protocol, const Bytes& bytes) {
  std::vector<RawSample> samples;
  Bytes reply;
  protocol.feed(bytes, samples, reply);
  EXPECT_TRUE(reply.empty());
  return samples;
}

TEST(RazerHydraProtocol, AReportHoldsBothControllers) {
  RazerHydraProtocol protocol;
  const auto samples = feed(
      protocol, report({1000, 200, -300, 16384, 8192, -4096, 2048}, {-1, -2, 3, -32768, 0, 0, 0}));
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].sensor, 1);
  EXPECT_EQ(samples[0].position_m, Eigen::Vector3d(1.0, -0.2, 0.3));
  EXPECT_EQ(samples[0].rotation.coeffs(), Eigen::Vector4d(0.25, 0.125, -0.0625, 0.5));
  EXPECT_FALSE(samples[0].ticks);
  EXPECT_FALSE(samples[0].sequence);
  EXPECT_EQ(samples[1].sensor, 2);
  EXPECT_EQ(samples[1].position_m, Eigen::Vector3d(-0.001, 0.002, -0.003));
  EXPECT_EQ(samples[1].rotation.w(), -1);
}

// The frame is turned and not mirrored: what the device turns from one vector into another, the
// sample turns from the one, turned, into the other, turned.
TEST(RazerHydraProtocol, PositionsAndRotationsAreTurnedAlike) {
  const Eigen::Quaterniond half_turn(0, 1, 0, 0);
  Pcg32 random(7);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Quaterniond device =
        Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal())
            .normalized();
    const auto unit = [](double x) { return static_cast<int>(x * 32767); };
    RazerHydraProtocol protocol;
    const auto samples = feed(
        protocol,
        report({0, 0, 0, unit(device.w()), unit(device.x()), unit(device.y()), unit(device.z())},
               kStill));
    ASSERT_EQ(samples.size(), 2U);
    const Eigen::Quaterniond expected = half_turn * device * half_turn.conjugate();
    constexpr double kQuantisation = 1e-3;  // rad; of 16 bits, with room
    EXPECT_LT(samples[0].rotation.normalized().angularDistance(expected), kQuantisation);
  }
}

TEST(RazerHydraProtocol, ReportsOfAnyOtherLengthAreDroppedAndCounted) {
  RazerHydraProtocol protocol;
  std::uint64_t dropped = 0;
  for (std::size_t size = 0; size < 130; ++size) {
    if (size == RazerHydraProtocol::kReportBytes) continue;
    EXPECT_TRUE(feed(protocol, Bytes(size)).empty()) << size;
    EXPECT_EQ(protocol.counters().bad_frames, ++dropped);
  }
}

TEST(RazerHydraProtocol, SomeStrangeReportsInARowMeanThatTheModeIsLost) {
  RazerHydraProtocol protocol;
  for (int i = 0; i < 100; ++i) {  // one now and then does not
    EXPECT_TRUE(feed(protocol, Bytes(16)).empty());
    EXPECT_EQ(feed(protocol, report(kStill, kStill)).size(), 2U);
    EXPECT_FALSE(protocol.wants_restart());
  }
  for (int i = 0; i < 8; ++i) {
    EXPECT_FALSE(protocol.wants_restart());
    EXPECT_TRUE(feed(protocol, Bytes(16)).empty());
  }
  EXPECT_TRUE(protocol.wants_restart());
  protocol.reset();
  EXPECT_FALSE(protocol.wants_restart());
  EXPECT_EQ(protocol.counters().bad_frames, 108U);  // counters stay
}

TEST(RazerHydraProtocol, AskingForMotionIsAFeatureReportWithItsChecksum) {
  const auto commands = RazerHydraProtocol().start();
  ASSERT_EQ(commands.size(), 1U);
  EXPECT_EQ(commands[0].kind, Command::Kind::kFeature);
  ASSERT_EQ(commands[0].bytes.size(), 91U);
  std::byte sum{};
  for (const std::byte byte : commands[0].bytes) sum ^= byte;
  EXPECT_EQ(sum, std::byte{});  // the checksum cancels the others
  EXPECT_EQ(commands[0].bytes[0], std::byte{}) << "the number of the report";
  EXPECT_EQ(commands[0].bytes[9], std::byte{3});
}

TEST(RazerHydraProtocol, TheHemisphereUndoesMirroringAndNothingElse) {
  const Eigen::Vector3d hemisphere(0, 0, 1);
  const std::array<int, 7> mirrored{-100, -200, 300, 32767, 0, 0, 0};
  RazerHydraProtocol guided(hemisphere);
  const auto right = feed(guided, report(kStill, mirrored));
  ASSERT_EQ(right.size(), 2U);
  EXPECT_EQ(right[0].position_m, right[1].position_m);
  EXPECT_EQ(right[0].rotation.coeffs(), right[1].rotation.coeffs());
  EXPECT_GT(right[0].position_m.dot(hemisphere), 0);
  RazerHydraProtocol unguided;
  const auto as_sent = feed(unguided, report(kStill, mirrored));
  EXPECT_EQ(as_sent[0].position_m, -as_sent[1].position_m);
}

TEST(RazerHydraProtocol, AnyBytesAreSurvived) {
  Pcg32 random(11);
  RazerHydraProtocol protocol(Eigen::Vector3d(0, 0, 1));
  for (int i = 0; i < 2000; ++i) {
    Bytes bytes(i % 2 == 0 ? RazerHydraProtocol::kReportBytes
                           : static_cast<std::size_t>(random.uniform() * 200));
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random.uniform() * 256);
    for (const RawSample& sample : feed(protocol, bytes)) {
      EXPECT_TRUE(sample.position_m.allFinite());
      EXPECT_LE(sample.position_m.cwiseAbs().maxCoeff(), 32.768);
      EXPECT_GE(sample.position_m.z(), 0);
    }
  }
}

}  // namespace
}  // namespace veneer::tracking
