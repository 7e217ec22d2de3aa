// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "base/random.h"
#include "projector/outputs/kms/fake_kms_device.h"
#include "projector/outputs/kms/kms_output.h"

// For tests of an output on a card that is played.
namespace veneer::projector {

inline bool same(const Image<Rgb16>& a, const Image<Rgb16>& b) {
  return a.width() == b.width() && std::ranges::equal(a.pixels(), b.pixels());
}

inline bool is_black(const Image<Rgb16>& image) {
  return !image.empty() && std::ranges::count(image.pixels(), Rgb16{}) ==
                               static_cast<std::ptrdiff_t>(image.pixels().size());
}

class KmsOutputTest : public testing::Test {
 protected:
  static constexpr int kWidth = 64;
  static constexpr int kHeight = 48;
  using Buffers = KmsOutputOptions::Buffers;

  KmsOutputTest() {
    card_.connectors = {{"HDMI-A-1",
                         fake_edid("EPSON PJ", "A1"),
                         true,
                         {fake_mode(kWidth, kHeight, 60, true), fake_mode(32, 24, 60)}}};
    options_.buffers = Buffers::kMapped;
  }

  static Image<Rgb16> random_picture(std::uint64_t seed, int bits) {
    Image<Rgb16> picture(kWidth, kHeight);
    Pcg32 random(seed);
    for (Rgb16& pixel : picture.pixels()) {
      for (std::uint16_t& code : pixel)
        code = static_cast<std::uint16_t>(random.next() >> static_cast<unsigned>(32 - bits));
    }
    return picture;
  }
  Status open() {
    auto device = std::make_unique<FakeKmsDevice>(card_, clock_);
    device_ = device.get();
    auto opened = KmsOutput::open(options_, std::move(device), clock_);
    if (!opened) return tl::unexpected<Error>(opened.error());
    output_ = std::move(*opened);
    return {};
  }
  Status show(const Image<Rgb16>& picture, int bits = 8) {
    Frame frame;
    frame.number = next_number_++;
    frame.codes = picture.view();
    frame.bits = bits;
    return output_->present(frame);
  }
  void wait(Duration duration) { clock_.sleep_until(clock_.now() + duration); }

  FakeCard card_;
  VirtualClock clock_{Time(std::chrono::seconds(5))};
  KmsOutputOptions options_;
  std::unique_ptr<KmsOutput> output_;
  FakeKmsDevice* device_ = nullptr;  // the output's
  std::uint64_t next_number_ = 0;
};

}  // namespace veneer::projector
