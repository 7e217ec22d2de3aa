// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/freed/freed_protocol.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "base/random.h"
#include "tracking/testing/freed_writer.h"
#include "tracking/testing/protocol_laws.h"

namespace veneer::tracking {
namespace {

using Eigen::Vector3d;
using freed::Bytes;
using freed::Message;

/// Angles come in steps of 1/32768 degree, 5e-7 rad: an axis is no nearer than that to where it
/// should point.
constexpr double kAngleStep_rad = 6e-7;

std::vector<RawSample> feed(FreedProtocol& protocol, const Bytes& datagram) {
  std::vector<RawSample> samples;
  Bytes reply;
  protocol.feed(datagram, samples, reply);
  EXPECT_TRUE(reply.empty());
  return samples;
}

RawSample sample_of(const Message& message, FreedProtocol::Up up = FreedProtocol::Up::kY) {
  FreedProtocol protocol(up, 50);
  const auto samples = feed(protocol, message.bytes());
  EXPECT_EQ(samples.size(), 1U);
  return samples.empty() ? RawSample{} : samples.front();
}

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

testing::AssertionResult near(const Vector3d& found, const Vector3d& wanted, double tolerance) {
  if ((found - wanted).norm() <= tolerance) return testing::AssertionSuccess();
  return testing::AssertionFailure() << found.transpose() << " is not " << wanted.transpose();
}

// Worked out by hand from the manual; the writer above has to agree with it.
TEST(FreedProtocol, ReadsTheTestVector) {
  const std::array<int, 29> vector{0xD1, 0x01, 0xF9, 0xC0, 0x00, 0x01, 0xA0, 0x00, 0x59, 0xFF,
                                   0xDF, 0xFE, 0xCB, 0x60, 0x00, 0x00, 0x01, 0x7F, 0xFF, 0xFF,
                                   0x00, 0x00, 0x64, 0x00, 0x10, 0x00, 0xBE, 0xEF, 0x15};
  Bytes bytes;
  for (const int each : vector) bytes.push_back(static_cast<std::byte>(each));
  const Message message{
      1, -12.5, 3.25, 179.999, {-1234.5, 0.015625, 131071.984375}, 100, 4096, 0xBEEF};
  EXPECT_EQ(message.bytes(), bytes);

  FreedProtocol protocol(FreedProtocol::Up::kZ, 50);
  const auto samples = feed(protocol, bytes);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].sensor, 1);
  EXPECT_TRUE(near(samples[0].position_m, {-1.2345, 0.000015625, 131.071984375}, 1e-12));
  EXPECT_EQ(protocol.counters().bad_frames, 0U);
  EXPECT_EQ(protocol.counters().skipped_bytes, 0U);
}

/// Where the axes of a body point in the world.
struct Axes {
  Vector3d right;
  Vector3d down;
  Vector3d forward;
};
Axes axes_of(const RawSample& sample) {
  return {sample.rotation * Vector3d::UnitX(),
          sample.rotation * Vector3d::UnitY(),
          sample.rotation * Vector3d::UnitZ()};
}

TEST(FreedProtocol, KnownDirectionsInAWorldWithYUp) {
  const Axes level = axes_of(sample_of({}));
  EXPECT_TRUE(near(level.forward, {0, 0, -1}, kAngleStep_rad));
  EXPECT_TRUE(near(level.right, {1, 0, 0}, kAngleStep_rad));
  EXPECT_TRUE(near(level.down, {0, -1, 0}, kAngleStep_rad));
  // Panned by 90 degrees, it looks to where its right was.
  const Axes panned = axes_of(sample_of({.pan_deg = 90}));
  EXPECT_TRUE(near(panned.forward, {1, 0, 0}, kAngleStep_rad));
  EXPECT_TRUE(near(panned.down, {0, -1, 0}, kAngleStep_rad));
  // Tilted by 90 degrees, it looks straight up.
  EXPECT_TRUE(near(axes_of(sample_of({.tilt_deg = 90})).forward, {0, 1, 0}, kAngleStep_rad));
  // Rolled by 90 degrees clockwise from behind, its right points down.
  const Axes rolled = axes_of(sample_of({.roll_deg = 90}));
  EXPECT_TRUE(near(rolled.forward, {0, 0, -1}, kAngleStep_rad));
  EXPECT_TRUE(near(rolled.right, {0, -1, 0}, kAngleStep_rad));
  EXPECT_TRUE(near(sample_of({.position_mm = {1000, 2000, 3000}}).position_m, {1, 3, -2}, 1e-12));
}

TEST(FreedProtocol, KnownDirectionsInAWorldWithZUp) {
  constexpr auto kUp = FreedProtocol::Up::kZ;
  EXPECT_TRUE(near(axes_of(sample_of({}, kUp)).forward, {0, 1, 0}, kAngleStep_rad));
  EXPECT_TRUE(near(axes_of(sample_of({.pan_deg = 90}, kUp)).forward, {1, 0, 0}, kAngleStep_rad));
  EXPECT_TRUE(near(axes_of(sample_of({.tilt_deg = 90}, kUp)).forward, {0, 0, 1}, kAngleStep_rad));
  EXPECT_TRUE(near(axes_of(sample_of({.roll_deg = 90}, kUp)).right, {0, 0, -1}, kAngleStep_rad));
  EXPECT_TRUE(
      near(sample_of({.position_mm = {1000, 2000, 3000}}, kUp).position_m, {1, 2, 3}, 1e-12));
}

// What the three angles mean together, by the definitions of the manual: pan is the azimuth of the
// axis, tilt its elevation, roll the turn about it from level.
TEST(FreedProtocol, AnglesCombineAsTheManualDefinesThem) {
  Pcg32 random(3);
  for (int i = 0; i < 200; ++i) {
    const Message message{.pan_deg = 360 * random.uniform() - 180,
                          .tilt_deg = 170 * random.uniform() - 85,
                          .roll_deg = 360 * random.uniform() - 180};
    const Axes axes = axes_of(sample_of(message, FreedProtocol::Up::kZ));
    const auto rad = [](double degrees) { return degrees * std::numbers::pi / 180; };
    const double pan = rad(message.pan_deg);
    const double tilt = rad(message.tilt_deg);
    const Vector3d forward(
        std::sin(pan) * std::cos(tilt), std::cos(pan) * std::cos(tilt), std::sin(tilt));
    const Vector3d level_right(std::cos(pan), -std::sin(pan), 0);
    EXPECT_TRUE(near(axes.forward, forward, 4 * kAngleStep_rad));
    const Vector3d right = std::cos(rad(message.roll_deg)) * level_right +
                           std::sin(rad(message.roll_deg)) * forward.cross(level_right);
    EXPECT_TRUE(near(axes.right, right, 4 * kAngleStep_rad));
    EXPECT_NEAR(axes.right.cross(axes.down).dot(axes.forward), 1, 1e-12);  // right-handed
  }
}

TEST(FreedProtocol, SeveralMessagesOfADatagramAreAllTaken) {
  FreedProtocol protocol(FreedProtocol::Up::kY, 50);
  const auto samples =
      feed(protocol, Message{.camera = 3}.bytes() + Message{.camera = 250}.bytes());
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].sensor, 3);
  EXPECT_EQ(samples[1].sensor, 250);
}

TEST(FreedProtocol, EveryFlippedBitIsFoundAndCounted) {
  const Bytes good = Message{7, 10, 20, 30, {400, 500, 600}, 7, 8, 9}.bytes();
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    FreedProtocol protocol(FreedProtocol::Up::kY, 50);
    Bytes bad = good;
    bad[bit / 8] ^= std::byte{1} << (bit % 8);
    EXPECT_TRUE(feed(protocol, bad).empty()) << bit;
    EXPECT_EQ(protocol.counters().skipped_bytes, good.size());
    if (bit >= 8) {
      EXPECT_EQ(protocol.counters().bad_frames, 1U) << bit;  // else it is no D1
    }
    EXPECT_EQ(feed(protocol, good).size(), 1U) << "the next datagram is whole";
  }
}

TEST(FreedProtocol, AMessageIsFoundBehindGarbageByteByByte) {
  const Bytes good = Message{.camera = 5, .pan_deg = 1}.bytes();
  for (std::size_t length = 1; length < 60; ++length) {
    // Garbage that looks like the beginning of messages.
    FreedProtocol protocol(FreedProtocol::Up::kY, 50);
    const auto samples = feed(protocol, Bytes(length, std::byte{0xD1}) + good);
    ASSERT_EQ(samples.size(), 1U) << length;
    EXPECT_EQ(samples[0].sensor, 5);
    EXPECT_EQ(protocol.counters().skipped_bytes, length);
  }
}

TEST(FreedProtocol, ACutMessageIsNeverJoinedToTheNext) {
  const Bytes good = Message{.camera = 5, .pan_deg = 1}.bytes();
  for (std::size_t length = 1; length < good.size(); ++length) {
    FreedProtocol protocol(FreedProtocol::Up::kY, 50);
    const auto middle = good.begin() + static_cast<std::ptrdiff_t>(length);
    EXPECT_TRUE(feed(protocol, Bytes(good.begin(), middle)).empty());
    EXPECT_TRUE(feed(protocol, Bytes(middle, good.end())).empty());
    EXPECT_EQ(protocol.counters().skipped_bytes, good.size());
    EXPECT_EQ(feed(protocol, good).size(), 1U);
  }
}

TEST(FreedProtocol, KeepsTheLawsOnNoise) {
  Pcg32 random(11);
  for (int i = 0; i < 300; ++i) {
    std::vector<Bytes> datagrams;
    for (int d = 0; d < 5; ++d) {
      Bytes bytes;
      while (random.next() % 4 != 0) {
        bytes = bytes + Message{.camera = static_cast<int>(random.next() % 256)}.bytes();
        for (std::uint32_t n = random.next() % 4; n > 0; --n)
          bytes[random.next() % bytes.size()] = static_cast<std::byte>(random.next());
      }
      datagrams.push_back(bytes);
    }
    const std::vector<std::span<const std::byte>> pieces(datagrams.begin(), datagrams.end());
    EXPECT_EQ(
        broken_law([] { return std::make_unique<FreedProtocol>(FreedProtocol::Up::kY, 50.0); },
                   Framing::kMessages,
                   pieces,
                   0),
        "");
  }
}

}  // namespace
}  // namespace veneer::tracking
