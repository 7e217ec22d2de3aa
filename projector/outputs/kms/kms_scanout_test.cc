// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <chrono>
#include <string>

#include "base/random.h"
#include "projector/outputs/kms/internal_output_testing.h"
#include "projector/outputs/kms/pixels.h"

// Buffers that a GPU draws into and the card shows.
namespace veneer::projector {
namespace {

class KmsGpuTest : public KmsOutputTest {
 protected:
  KmsGpuTest() {
    card_.gpu = true;
    options_.buffers = Buffers::kAuto;
  }
  /// What a GPU would do.
  void draw(std::size_t buffer, const Image<Rgb16>& picture) {
    const DmaBuffer& target = output_->scanout()->buffers[buffer];
    const std::size_t bytes = std::size_t{target.stride} * static_cast<std::size_t>(target.height);
    void* memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, target.descriptor, 0);
    ASSERT_NE(memory, MAP_FAILED);
    write_pixels(picture.view(),
                 8,
                 8,
                 {static_cast<std::uint32_t*>(memory),
                  target.width,
                  target.height,
                  static_cast<std::ptrdiff_t>(target.stride / 4)});
    ::munmap(memory, bytes);
  }
  Status show_buffer(std::size_t buffer) {
    Frame frame;
    frame.number = next_number_++;
    frame.buffer = buffer;
    return output_->present(frame);
  }
};

TEST_F(KmsGpuTest, WhatTheGpuDrewIsShownAndNeverWhileItDraws) {
  ASSERT_TRUE(open());
  ASSERT_NE(output_->scanout(), nullptr);
  EXPECT_EQ(output_->scanout()->buffers.size(), 3U);
  EXPECT_NE(output_->scanout()->gbm_device, nullptr);
  EXPECT_FALSE(output_->wants_pixels(0));
  Pcg32 random(5);
  for (std::uint64_t number = 0; number < 100; ++number) {
    const auto buffer = output_->next_buffer();
    ASSERT_TRUE(buffer);
    const Image<Rgb16> picture = random_picture(number, 8);
    draw(*buffer, picture);
    wait(std::chrono::microseconds(random.next() % 40'000));
    ASSERT_TRUE(show_buffer(*buffer));
    if (number % 10 == 9) {
      ASSERT_TRUE(output_->finish());
      EXPECT_TRUE(same(device_->screen(), picture)) << number;
      ASSERT_TRUE(output_->blank());
    }
  }
  EXPECT_EQ(card_.torn, 0);
}

TEST_F(KmsGpuTest, ABufferThatIsShownIsNotTaken) {
  ASSERT_TRUE(open());
  const auto first = output_->next_buffer();
  ASSERT_TRUE(first);
  ASSERT_TRUE(show_buffer(*first));
  EXPECT_EQ(show_buffer(*first).error().code, Errc::kInvalidOption);
  ASSERT_TRUE(output_->finish());
  EXPECT_EQ(show_buffer(*first).error().code, Errc::kInvalidOption);
  EXPECT_EQ(show_buffer(3).error().code, Errc::kInvalidOption);
  EXPECT_EQ(show(random_picture(1, 8)).error().code, Errc::kInvalidOption);
}

TEST_F(KmsGpuTest, GivenUpItTakesPixelsAndIsDarkInBetween) {
  ASSERT_TRUE(open());
  const auto buffer = output_->next_buffer();
  draw(*buffer, random_picture(1, 8));
  ASSERT_TRUE(show_buffer(*buffer));
  output_->give_up_scanout();
  EXPECT_EQ(output_->scanout(), nullptr);
  EXPECT_TRUE(output_->wants_pixels(0));
  EXPECT_TRUE(is_black(device_->screen()));
  EXPECT_FALSE(output_->next_buffer());
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const Image<Rgb16> picture = random_picture(seed, 8);
    ASSERT_TRUE(show(picture));
    ASSERT_TRUE(output_->finish());
    EXPECT_TRUE(same(device_->screen(), picture));
  }
  EXPECT_EQ(card_.torn, 0);
}

TEST_F(KmsGpuTest, WithoutAGpuPixelsAreCopiedUnlessToldOtherwise) {
  card_.gpu = false;
  ASSERT_TRUE(open());
  EXPECT_EQ(output_->scanout(), nullptr);
  output_.reset();
  options_.buffers = Buffers::kGpu;
  const Status opened = open();
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().what.find("mapped"), std::string::npos) << opened.error().what;
}

TEST_F(KmsGpuTest, UnpluggedItGivesNoBuffer) {
  ASSERT_TRUE(open());
  card_.connectors[0].connected = false;
  card_.changed = true;
  const auto buffer = output_->next_buffer();
  ASSERT_FALSE(buffer);
  EXPECT_EQ(buffer.error().code, Errc::kUnavailable);
}

}  // namespace
}  // namespace veneer::projector
