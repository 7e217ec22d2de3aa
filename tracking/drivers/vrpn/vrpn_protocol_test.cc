// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/vrpn/vrpn_protocol.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/random.h"
#include "tracking/testing/protocol_laws.h"
#include "tracking/testing/vrpn_writer.h"

namespace veneer::tracking {
namespace {

using vrpn::Bytes;
using vrpn::operator+;

constexpr const char* kName = "Tracker0";

struct Said {
  std::vector<RawSample> samples;
  Bytes reply;
};
Said feed(VrpnProtocol& protocol, const Bytes& bytes) {
  Said said;
  protocol.feed(bytes, said.samples, said.reply);
  return said;
}

std::unique_ptr<Protocol> make() { return std::make_unique<VrpnProtocol>(kName, 100); }

Bytes pose(double x, vrpn::Stamp stamp = {10, 20}) {
  return vrpn::pose_message(
      vrpn::kTracker, vrpn::kPose, {2, {x, -2.5, 1e-3}, {0.1, 0.2, 0.3, 0.9}}, stamp);
}

/// Broken off once and for all, until reset().
testing::AssertionResult gives_up(const Bytes& bytes) {
  VrpnProtocol protocol(kName, 100);
  feed(protocol, bytes);
  if (!protocol.wants_restart()) return testing::AssertionFailure() << "no wish for a restart";
  if (protocol.counters().bad_frames != 1)
    return testing::AssertionFailure() << protocol.counters().bad_frames << " bad frames";
  const Said after = feed(protocol, vrpn::greeting(kName) + pose(1));
  if (!after.samples.empty()) return testing::AssertionFailure() << "goes on all the same";
  protocol.reset();
  if (protocol.wants_restart()) return testing::AssertionFailure() << "reset() does not help";
  if (feed(protocol, vrpn::greeting(kName) + pose(1)).samples.size() != 1)
    return testing::AssertionFailure() << "a new connection is not understood";
  return testing::AssertionSuccess();
}

TEST(VrpnProtocol, SaysWhatTheServerSays) {
  VrpnProtocol protocol(kName, 100);
  const Said said = feed(protocol, vrpn::greeting(kName) + pose(1.25, {1'700'000'000, 999'999}));
  ASSERT_EQ(said.samples.size(), 1U);
  const RawSample& sample = said.samples[0];
  EXPECT_EQ(sample.sensor, 2);
  EXPECT_EQ(sample.ticks, 1'700'000'000'999'999U);
  EXPECT_EQ(sample.position_m, Eigen::Vector3d(1.25, -2.5, 1e-3));
  EXPECT_EQ(sample.rotation.coeffs(), Eigen::Vector4d(0.1, 0.2, 0.3, 0.9));  // x, y, z, w
  EXPECT_TRUE(said.reply.empty());
  EXPECT_EQ(protocol.counters().bad_frames, 0U);
  EXPECT_EQ(protocol.counters().skipped_bytes, 0U);
}

TEST(VrpnProtocol, GreetsAndNamesWhatItSends) {
  const auto commands = VrpnProtocol(kName, 100).start();
  ASSERT_EQ(commands.size(), 1U);
  EXPECT_EQ(commands[0].pause, Duration{0}) << "what is said meanwhile would be lost";
  // What we say has to make sense to our own reader: it names a tracker and ping messages.
  VrpnProtocol reader(kName, 100);
  EXPECT_TRUE(feed(reader, commands[0].bytes).samples.empty());
  const auto ping = VrpnProtocol(kName, 100).restart();
  ASSERT_EQ(ping.size(), 1U);
  EXPECT_FALSE(feed(reader, ping[0].bytes).reply.empty());
  EXPECT_FALSE(reader.wants_restart());
  // And byte for byte as the document has it.
  Bytes cookie = vrpn::cookie("07.38");
  EXPECT_TRUE(std::equal(cookie.begin(), cookie.end(), commands[0].bytes.begin()));
  EXPECT_EQ(commands[0].bytes.size() % 8, 0U);
}

TEST(VrpnProtocol, AnswersAPingOfItsTrackerOnly) {
  VrpnProtocol protocol(kName, 100);
  feed(protocol, vrpn::greeting(kName));
  EXPECT_TRUE(feed(protocol, vrpn::message(2, vrpn::kPing, {})).reply.empty());
  const Bytes pong = feed(protocol, vrpn::message(vrpn::kTracker, vrpn::kPing, {})).reply;
  ASSERT_EQ(pong.size(), 24U);
  EXPECT_EQ(std::to_integer<int>(pong[3]), 24);  // length
  EXPECT_EQ(std::to_integer<int>(pong[19]), 1);  // the number start() gave to pong messages
}

TEST(VrpnProtocol, NumbersAreOfTheConnectionAndMatchedByName) {
  VrpnProtocol protocol(kName, 100);
  feed(protocol, vrpn::greeting(kName));
  // Another device, another type, a number nobody described.
  EXPECT_TRUE(feed(protocol, vrpn::pose_message(2, vrpn::kPose, {}, {})).samples.empty());
  EXPECT_TRUE(feed(protocol, vrpn::pose_message(vrpn::kTracker, 6, {}, {})).samples.empty());
  EXPECT_TRUE(feed(protocol, vrpn::pose_message(99, 99, {}, {})).samples.empty());
  // The server gives the tracker's number to another.
  feed(protocol, vrpn::description(vrpn::kSenderDescription, vrpn::kTracker, "Tracker00"));
  EXPECT_TRUE(feed(protocol, pose(1)).samples.empty());
  feed(protocol, vrpn::description(vrpn::kSenderDescription, 40, kName));
  EXPECT_EQ(feed(protocol, vrpn::pose_message(40, vrpn::kPose, {}, {})).samples.size(), 1U);
  // After a reconnection numbers mean nothing until they are described.
  protocol.reset();
  feed(protocol, vrpn::cookie());
  EXPECT_TRUE(feed(protocol, vrpn::pose_message(40, vrpn::kPose, {}, {})).samples.empty());
  EXPECT_EQ(protocol.counters().bad_frames, 0U);
}

TEST(VrpnProtocol, MessagesOfTheSystemArePassedOver) {
  VrpnProtocol protocol(kName, 100);
  const Bytes address = vrpn::description(-3, 40000, "192.0.2.1");
  const Bytes log = vrpn::description(-4, 3, "file");
  const Said said =
      feed(protocol, vrpn::greeting(kName) + address + log + vrpn::message(0, -5, {}) + pose(1));
  EXPECT_EQ(said.samples.size(), 1U);
  EXPECT_TRUE(said.reply.empty()) << "no UDP port is ever named";
  EXPECT_EQ(protocol.counters().bad_frames, 0U);
}

TEST(VrpnProtocol, AnotherVersionIsRefused) {
  for (const char* version : {"08.00", "06.35", "7.35", "070.3"})
    EXPECT_TRUE(gives_up(vrpn::cookie(version))) << version;
  Bytes web(40, std::byte{'H'});
  EXPECT_TRUE(gives_up(web));
  for (const char* version : {"07.00", "07.38", "07.99"}) {
    VrpnProtocol protocol(kName, 100);
    feed(protocol, vrpn::cookie(version));
    EXPECT_FALSE(protocol.wants_restart()) << version;
  }
}

TEST(VrpnProtocol, HostileLengthsBreakOff) {
  for (const std::int64_t length :
       {0LL, 1LL, 23LL, 64001LL, 1LL << 24, (1LL << 31) - 1, 1LL << 31, (1LL << 32) - 1}) {
    EXPECT_TRUE(gives_up(vrpn::greeting(kName) + vrpn::message(3, 7, Bytes(64), {}, length)))
        << length;
  }
}

TEST(VrpnProtocol, HostileDescriptionsBreakOff) {
  const auto described = [](std::int32_t count, const Bytes& name, std::int32_t number = 5) {
    Bytes payload;
    vrpn::put(payload, count);
    return vrpn::cookie() + vrpn::message(number, -1, payload + name);
  };
  const Bytes name{std::byte{'T'}, std::byte{'r'}, std::byte{0}};
  VrpnProtocol protocol(kName, 100);
  feed(protocol, described(3, name));
  EXPECT_FALSE(protocol.wants_restart());
  EXPECT_TRUE(gives_up(described(3, {std::byte{'T'}, std::byte{'r'}, std::byte{'k'}})));  // no zero
  for (const std::int32_t count : {0, -1, 4, 1 << 30, std::numeric_limits<std::int32_t>::min()})
    EXPECT_TRUE(gives_up(described(count, name))) << count;
  EXPECT_TRUE(gives_up(described(3, name, -1)));
  EXPECT_TRUE(gives_up(vrpn::cookie() + vrpn::message(5, -2, {})));
  EXPECT_TRUE(gives_up(vrpn::cookie() + vrpn::message(5, -2, Bytes(3))));
}

TEST(VrpnProtocol, APoseOfTheWrongSizeIsCountedAndTheNextOneTaken) {
  for (const std::size_t size : {0U, 1U, 56U, 63U, 65U, 72U}) {
    VrpnProtocol protocol(kName, 100);
    feed(protocol, vrpn::greeting(kName));
    const Bytes wrong = vrpn::message(vrpn::kTracker, vrpn::kPose, Bytes(size));
    EXPECT_EQ(feed(protocol, wrong + pose(1)).samples.size(), 1U) << size;
    EXPECT_EQ(protocol.counters().bad_frames, 1U);
    EXPECT_FALSE(protocol.wants_restart());
  }
  VrpnProtocol protocol(kName, 100);
  feed(protocol, vrpn::greeting(kName));
  const Bytes negative = vrpn::pose_message(vrpn::kTracker, vrpn::kPose, {-1, {}, {}}, {});
  EXPECT_TRUE(feed(protocol, negative).samples.empty());
  EXPECT_EQ(protocol.counters().bad_frames, 1U);
}

/// A conversation with everything in it.
Bytes conversation() {
  Bytes bytes = vrpn::greeting(kName);
  for (int i = 0; i < 6; ++i) {
    bytes = bytes + pose(i, {i, i}) + vrpn::message(vrpn::kTracker, vrpn::kPing, {}) +
            vrpn::message(2, 1, Bytes(static_cast<std::size_t>(i)));
  }
  return bytes + vrpn::description(vrpn::kTypeDescription, 50, "vrpn_Tracker Pos_Quat") +
         vrpn::pose_message(vrpn::kTracker, 50, {}, {});
}

TEST(VrpnProtocol, EveryWayToCutAStreamGivesTheSame) {
  const Bytes bytes = conversation();
  const std::vector<std::span<const std::byte>> whole{bytes};
  for (std::size_t cut = 0; cut < bytes.size(); ++cut)
    ASSERT_EQ(broken_law(&make, Framing::kStream, whole, cut), "");
  // Byte by byte, and in random pieces.
  const auto protocol = make();
  const Understanding first = understand(*protocol, whole);
  EXPECT_EQ(first.samples.size(), 7U);
  Pcg32 random(5);
  for (int i = 0; i < 100; ++i) {
    std::vector<std::span<const std::byte>> pieces;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t size =
          i == 0 ? 1 : std::min<std::size_t>(random.next() % 200, bytes.size() - at);
      pieces.push_back(std::span(bytes).subspan(at, size));
      at += size;
    }
    const Understanding cut = understand(*make(), pieces);
    EXPECT_TRUE(std::equal(cut.samples.begin(),
                           cut.samples.end(),
                           first.samples.begin(),
                           first.samples.end(),
                           identical));
    EXPECT_EQ(cut.reply, first.reply);
  }
}

TEST(VrpnProtocol, KeepsTheLawsOnDamagedStreams) {
  Pcg32 random(17);
  for (int i = 0; i < 3000; ++i) {
    Bytes bytes = conversation();
    for (std::uint32_t n = 1 + random.next() % 3; n > 0; --n)
      bytes[random.next() % bytes.size()] = static_cast<std::byte>(random.next());
    const std::vector<std::span<const std::byte>> whole{bytes};
    ASSERT_EQ(broken_law(&make, Framing::kStream, whole, random.next()), "") << i;
  }
}

}  // namespace
}  // namespace veneer::tracking
