// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/kms_output.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <string>

#include "base/random.h"
#include "projector/outputs.h"
#include "projector/outputs/kms/internal_output_testing.h"
#include "projector/outputs/kms/pixels.h"

namespace veneer::projector {
namespace {

TEST_F(KmsOutputTest, IsDarkUntilTheFirstFrame) {
  ASSERT_TRUE(open());
  EXPECT_TRUE(is_black(device_->screen()));
  EXPECT_FALSE(output_->last_presented());
}

TEST_F(KmsOutputTest, EveryCodeLeavesTheConnectorUnchanged) {
  for (const int bits : {8, 10}) {
    options_.bits = bits;
    output_.reset();
    ASSERT_TRUE(open());
    EXPECT_TRUE(output_->wants_pixels(0));
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      const Image<Rgb16> picture = random_picture(seed, bits);
      ASSERT_TRUE(show(picture, bits));
      ASSERT_TRUE(output_->finish());
      EXPECT_TRUE(same(device_->screen(), picture)) << bits << " bits, picture " << seed;
    }
  }
}

TEST_F(KmsOutputTest, CodesOfEightBitsAreWidenedToTen) {
  options_.bits = 10;
  ASSERT_TRUE(open());
  const Image<Rgb16> picture = random_picture(1, 8);
  ASSERT_TRUE(show(picture, 8));
  ASSERT_TRUE(output_->finish());
  const Image<Rgb16> screen = device_->screen();
  for (std::size_t i = 0; i < picture.pixels().size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      ASSERT_EQ(screen.pixels()[i][c], widen_code(picture.pixels()[i][c], 8, 10));
  }
}

TEST_F(KmsOutputTest, RefusesWhatItWouldHaveToChange) {
  ASSERT_TRUE(open());
  const Status deep = show(random_picture(1, 10), 10);
  ASSERT_FALSE(deep);
  EXPECT_EQ(deep.error().code, Errc::kInvalidOption);
  EXPECT_NE(deep.error().what.find("set bits of [output] to 10"), std::string::npos);
  const Status small = show(Image<Rgb16>(kWidth - 1, kHeight));
  ASSERT_FALSE(small);
  EXPECT_EQ(small.error().code, Errc::kInvalidOption);
  EXPECT_FALSE(show(Image<Rgb16>()));
  EXPECT_TRUE(is_black(device_->screen()));
}

TEST_F(KmsOutputTest, FramesAreStampedByTheRetraceThatShowsThem) {
  ASSERT_TRUE(open());
  ASSERT_TRUE(output_->refresh_period());
  EXPECT_NEAR(to_seconds(*output_->refresh_period()), 1 / 60.0, 1e-9);
  Time last;
  for (std::uint64_t number = 0; number < 20; ++number) {
    const Time begin = clock_.now();
    ASSERT_TRUE(show(random_picture(number, 8)));
    ASSERT_TRUE(output_->finish());
    const auto seen = output_->last_presented();
    ASSERT_TRUE(seen);
    EXPECT_EQ(seen->number, number);
    EXPECT_EQ(seen->time.time_since_epoch() % card_.period, Duration::zero());
    EXPECT_GT(seen->time, begin);
    EXPECT_LE(seen->time - begin, card_.period);
    EXPECT_GT(seen->time, last);
    last = seen->time;
    wait(std::chrono::milliseconds(3 * number));
  }
}

TEST_F(KmsOutputTest, AQuickProgramIsHeldToTheRetraceAndTheWaitsAreCounted) {
  ASSERT_TRUE(open());
  constexpr std::uint64_t kFrames = 50;
  const Time begin = clock_.now();
  for (std::uint64_t number = 0; number < kFrames; ++number)
    ASSERT_TRUE(show(random_picture(number, 8)));
  ASSERT_TRUE(output_->finish());
  EXPECT_GE(clock_.now() - begin, (kFrames - 1) * card_.period);
  EXPECT_LE(clock_.now() - begin, (kFrames + 1) * card_.period);
  EXPECT_EQ(output_->waits(),
            kFrames);  // all but the first waited for the one before; finish() too
  EXPECT_EQ(card_.torn, 0);
}

TEST_F(KmsOutputTest, NoBufferIsWrittenWhileItIsShownWhateverTheRhythm) {
  ASSERT_TRUE(open());
  Pcg32 random(3);
  for (std::uint64_t number = 0; number < 300; ++number) {
    const Image<Rgb16> picture = random_picture(number, 8);
    ASSERT_TRUE(show(picture));
    wait(std::chrono::microseconds(random.next() % 40'000));
    if (random.next() % 5 == 0) {
      ASSERT_TRUE(output_->blank());
    }
    if (random.next() % 7 == 0) card_.changed = true;
  }
  EXPECT_EQ(card_.torn, 0);
}

TEST_F(KmsOutputTest, BlankIsBlackWithinARefreshAndEndsWithTheNextFrame) {
  ASSERT_TRUE(open());
  const Image<Rgb16> picture = random_picture(1, 8);
  for (const bool under_way : {false, true}) {
    ASSERT_TRUE(show(picture));
    if (!under_way) {
      ASSERT_TRUE(output_->finish());
    }
    const Time begin = clock_.now();
    ASSERT_TRUE(output_->blank());
    ASSERT_TRUE(output_->blank());  // nothing more to do
    ASSERT_TRUE(output_->finish());
    EXPECT_TRUE(is_black(device_->screen()));
    EXPECT_LE(clock_.now() - begin, 2 * card_.period);
  }
  ASSERT_TRUE(show(picture));
  ASSERT_TRUE(output_->finish());
  EXPECT_TRUE(same(device_->screen(), picture));
}

TEST_F(KmsOutputTest, OtherProgramsLeftoversDoNotCoverThePicture) {
  auto device = std::make_unique<FakeKmsDevice>(card_, clock_);
  device_ = device.get();
  ASSERT_EQ(device->become_master(), 0);
  auto buffer = device->create_buffer(8, 8, kXrgb8888, KmsMemory::kMapped);
  ASSERT_TRUE(buffer);
  device->set_value(FakeKmsDevice::cursor_id(0), "CRTC_ID", FakeKmsDevice::crtc_id(0));
  device->set_value(FakeKmsDevice::cursor_id(0), "FB_ID", buffer->framebuffer);
  auto opened = KmsOutput::open(options_, std::move(device), clock_);
  ASSERT_TRUE(opened) << opened.error().what;
  output_ = std::move(*opened);
  EXPECT_EQ(device_->value(FakeKmsDevice::cursor_id(0), "FB_ID"), 0U);
  EXPECT_EQ(device_->value(FakeKmsDevice::primary_id(0), "rotation"), 1U);  // upright
  EXPECT_EQ(device_->value(FakeKmsDevice::primary_id(0), "alpha"), 0xffffU);
  // Else the retrace would come when the card likes.
  EXPECT_EQ(device_->value(FakeKmsDevice::crtc_id(0), "VRR_ENABLED"), 0U);
}

TEST_F(KmsOutputTest, TenBitsAreAskedForFirstAndGivenUpAsConfigured) {
  options_.bits = 10;
  const auto refuses_ten = [this](const char* why) {
    SCOPED_TRACE(why);
    options_.bits_fallback = false;
    const Status refused = open();
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kUnavailable);
    EXPECT_NE(refused.error().what.find("bits_fallback"), std::string::npos)
        << refused.error().what;
    options_.bits_fallback = true;
    const Status opened = open();
    ASSERT_TRUE(opened) << opened.error().what;
    EXPECT_EQ(output_->bits(), 8);
    EXPECT_TRUE(show(random_picture(1, 8)));
    output_.reset();
  };
  card_.formats = {kXrgb8888};
  refuses_ten("no format");
  card_.formats = {kXrgb8888, kXrgb2101010};
  card_.most_bits = 8;
  refuses_ten("no link");
  card_.most_bits = 12;
  int tests = 0;
  card_.refuse = [&tests](KmsCommit how) {
    return how == KmsCommit::kTest && tests++ == 0 ? EINVAL : 0;
  };
  options_.bits_fallback = true;
  ASSERT_TRUE(open());
  EXPECT_EQ(output_->bits(), 8);
  output_.reset();
  card_.refuse = nullptr;
  card_.most_bits.reset();  // without the property there is nothing to ask
  ASSERT_TRUE(open());
  EXPECT_EQ(output_->bits(), 10);
}

TEST_F(KmsOutputTest, TheLinkCarriesAsManyBitsAsTheBuffers) {
  for (const int bits : {8, 10}) {
    options_.bits = bits;
    output_.reset();
    ASSERT_TRUE(open());
    EXPECT_EQ(device_->value(FakeKmsDevice::connector_id(0), "max bpc"),
              static_cast<std::uint64_t>(bits));
  }
}

TEST_F(KmsOutputTest, UnpluggedItIsUnavailableAndComesBackByItself) {
  ASSERT_TRUE(open());
  const Image<Rgb16> picture = random_picture(1, 8);
  for (const bool event : {true, false}) {  // with udev and without
    ASSERT_TRUE(show(picture));
    ASSERT_TRUE(output_->finish());
    card_.connectors[0].connected = false;
    card_.changed = event;
    if (!event) card_.refuse = [](KmsCommit how) { return how == KmsCommit::kTest ? 0 : EINVAL; };
    for (int i = 0; i < 100; ++i) {
      const Status away = show(picture);
      ASSERT_FALSE(away);
      EXPECT_EQ(away.error().code, Errc::kUnavailable);
      EXPECT_EQ(output_->blank().error().code, Errc::kUnavailable);
      wait(card_.period);
    }
    card_.refuse = nullptr;
    const int before = card_.full_commits;
    card_.connectors[0].connected = true;
    card_.changed = event;
    if (!event) wait(KmsOutput::kRetryPeriod);
    const Status back = show(picture);
    ASSERT_TRUE(back) << back.error().what;
    EXPECT_EQ(card_.full_commits, before + 1);
    ASSERT_TRUE(output_->finish());
    EXPECT_TRUE(same(device_->screen(), picture));
  }
  EXPECT_EQ(card_.torn, 0);
}

TEST_F(KmsOutputTest, AnEventOfAnotherDisplayLeavesThePictureAlone) {
  ASSERT_TRUE(open());
  const Image<Rgb16> picture = random_picture(1, 8);
  ASSERT_TRUE(show(picture));
  ASSERT_TRUE(output_->finish());
  card_.changed = true;
  ASSERT_TRUE(show(random_picture(2, 8)));  // under way; the first is still shown
  EXPECT_TRUE(same(device_->screen(), picture));
}

TEST_F(KmsOutputTest, AnotherDisplayInItsPlaceIsNotTakenForIt) {
  options_.connector = "EPSON PJ";
  ASSERT_TRUE(open());
  const std::string own = card_.connectors[0].edid;
  card_.connectors[0].edid = fake_edid("SONY", "9");
  card_.changed = true;
  const Status other = show(random_picture(1, 8));
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, Errc::kUnavailable);
  EXPECT_NE(other.error().what.find("SONY"), std::string::npos) << other.error().what;
  card_.connectors[0].edid = own;
  card_.changed = true;
  EXPECT_TRUE(show(random_picture(1, 8)));
}

TEST_F(KmsOutputTest, AnotherDisplayIsKnownForWhatItIsAfterAPause) {
  options_.connector = "EPSON PJ";
  ASSERT_TRUE(open());
  const FakeConnector own = card_.connectors[0];
  const auto plug = [this](const FakeConnector& connector) {
    card_.connectors[0] = connector;
    card_.changed = true;
    return show(random_picture(1, 8));
  };
  ASSERT_FALSE(plug({"HDMI-A-1", "", false, {}}));
  const Status other = plug({"HDMI-A-1", fake_edid("SONY", "9"), true, own.modes});
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().what.find("SONY"), std::string::npos) << other.error().what;
  ASSERT_FALSE(plug({"HDMI-A-1", "", false, {}}));
  const Status other_modes = plug({"HDMI-A-1", own.edid, true, {fake_mode(32, 24, 60)}});
  ASSERT_FALSE(other_modes);
  EXPECT_NE(other_modes.error().what.find("64x48@60.00"), std::string::npos)
      << other_modes.error().what;
  EXPECT_TRUE(plug(own));
}

TEST_F(KmsOutputTest, ADisplayThatLostTheModeIsUnavailable) {
  ASSERT_TRUE(open());
  card_.connectors[0].modes = {fake_mode(32, 24, 60)};
  card_.changed = true;
  const Status away = show(random_picture(1, 8));
  ASSERT_FALSE(away);
  EXPECT_EQ(away.error().code, Errc::kUnavailable);
  EXPECT_NE(away.error().what.find("64x48@60.00"), std::string::npos) << away.error().what;
}

TEST_F(KmsOutputTest, WhenAnotherProgramTakesTheCardItWaitsForItsTurn) {
  ASSERT_TRUE(open());
  const Image<Rgb16> picture = random_picture(1, 8);
  ASSERT_TRUE(show(picture));
  ASSERT_TRUE(output_->finish());
  card_.other_master = true;
  const int asked = card_.masters_asked;
  for (int i = 0; i < 120; ++i) {  // two seconds
    const Status away = show(picture);
    ASSERT_FALSE(away);
    EXPECT_EQ(away.error().code, Errc::kUnavailable);
    EXPECT_NE(away.error().what.find("another program"), std::string::npos);
    wait(card_.period);
  }
  EXPECT_LE(card_.masters_asked - asked, 8);  // four a second
  card_.other_master = false;
  wait(KmsOutput::kRetryPeriod);
  const int before = card_.full_commits;
  ASSERT_TRUE(show(picture));
  EXPECT_EQ(card_.full_commits, before + 1);
  ASSERT_TRUE(output_->finish());
  EXPECT_TRUE(same(device_->screen(), picture));
}

TEST_F(KmsOutputTest, ACardThatAnotherProgramHoldsIsNotOpened) {
  card_.other_master = true;
  const Status opened = open();
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, Errc::kUnavailable);
  EXPECT_NE(opened.error().what.find("display-manager"), std::string::npos) << opened.error().what;
}

TEST_F(KmsOutputTest, AHungCardIsNoticedInTimeAndNeverWaitedForAgain) {
  ASSERT_TRUE(open());
  ASSERT_TRUE(show(random_picture(1, 8)));
  ASSERT_TRUE(output_->finish());
  card_.hangs = true;
  ASSERT_TRUE(show(random_picture(2, 8)));
  const Time begin = clock_.now();
  const Status hung = show(random_picture(3, 8));
  ASSERT_FALSE(hung);
  EXPECT_EQ(hung.error().code, Errc::kTimeout);
  EXPECT_EQ(clock_.now() - begin, KmsOutput::kFlipTimeout);
  EXPECT_EQ(output_->last_presented()->number, 0U);
}

TEST_F(KmsOutputTest, ACardThatWaitsForAnUnpluggedDisplayIsNotHung) {
  ASSERT_TRUE(open());
  ASSERT_TRUE(show(random_picture(1, 8)));
  card_.hangs = true;
  card_.connectors[0].connected = false;  // and no event of udev says so
  const Status away = show(random_picture(2, 8));
  ASSERT_FALSE(away);
  EXPECT_EQ(away.error().code, Errc::kUnavailable);
  card_.hangs = false;
  card_.connectors[0].connected = true;
  wait(KmsOutput::kRetryPeriod);
  const Image<Rgb16> picture = random_picture(3, 8);
  ASSERT_TRUE(show(picture));
  ASSERT_TRUE(output_->finish());
  EXPECT_TRUE(same(device_->screen(), picture));
}

TEST_F(KmsOutputTest, EveryRefusalIsExplained) {
  ASSERT_TRUE(open());
  const auto refused = [this](int error) {
    card_.refuse = [error](KmsCommit) { return error; };
    const Status shown = show(random_picture(1, 8));
    card_.refuse = nullptr;
    return shown ? Error{} : shown.error();
  };
  EXPECT_NE(refused(ENOSPC).what.find("bandwidth"), std::string::npos);
  EXPECT_EQ(refused(ENOSPC).code, Errc::kIo);
  EXPECT_NE(refused(EINVAL).what.find("another mode"), std::string::npos);
  EXPECT_NE(refused(ENOMEM).what.find("memory"), std::string::npos);
  EXPECT_EQ(refused(ENODEV).code, Errc::kDisconnected);
  const Time begin = clock_.now();
  EXPECT_NE(refused(EBUSY).what.find("busy"), std::string::npos);
  EXPECT_LE(clock_.now() - begin, 3 * card_.period);  // it is waited for, but not for long
  int left = 3;
  card_.refuse = [&left](KmsCommit) { return left-- > 0 ? EBUSY : 0; };
  EXPECT_TRUE(show(random_picture(1, 8)));
}

TEST_F(KmsOutputTest, AVanishedCardIsToBeOpenedAgain) {
  ASSERT_TRUE(open());
  card_.gone = true;
  const Status gone = show(random_picture(1, 8));
  ASSERT_FALSE(gone);
  EXPECT_EQ(gone.error().code, Errc::kDisconnected);
}

TEST_F(KmsOutputTest, NothingOfTheCardsIsLeftBehind) {
  std::size_t blobs = 0;
  {
    ASSERT_TRUE(open());
    EXPECT_EQ(device_->blobs_of_callers(), 1U);  // the mode
    card_.changed = true;
    ASSERT_TRUE(show(random_picture(1, 8)));
    blobs = device_->blobs_of_callers();
  }
  EXPECT_EQ(blobs, 1U);
}

TEST_F(KmsOutputTest, OptionsOutOfRangeAreRefused) {
  for (const int bits : {-1, 0, 7, 9, 12, 16}) {
    options_.bits = bits;
    const Status opened = open();
    ASSERT_FALSE(opened) << bits;
    EXPECT_EQ(opened.error().code, Errc::kInvalidOption);
  }
  for (const char* text : {"buffers = \"vram\"", "bits = 9", "unknown = 1", "mode = 3"}) {
    auto toml = TomlReader::parse(fmt::format("driver = \"kms\"\n{}", text), "test");
    ASSERT_TRUE(toml);
    EXPECT_FALSE(open_output(*toml) && toml->finish()) << text;
  }
}

TEST(KmsOutputState, IsWhereTheTableSaysOrElseTheCaller) {
  const auto refused = [](const std::string& keys) {
    auto toml = TomlReader::parse("driver = \"kms\"\n" + keys, "test");
    const auto output = open_output(*toml, "/proc/of-the-caller");
    return output ? std::string() : output.error().what;
  };
  EXPECT_NE(refused("").find("/proc/of-the-caller"), std::string::npos) << refused("");
  const std::string own = refused("state_directory = \"/proc/of-the-table\"");
  EXPECT_NE(own.find("/proc/of-the-table"), std::string::npos) << own;
  EXPECT_NE(own.find("may write"), std::string::npos) << own;
}

}  // namespace
}  // namespace veneer::projector
