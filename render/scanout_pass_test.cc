// SPDX-License-Identifier: Apache-2.0
#include "render/scanout_pass.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "render/egl_context.h"

namespace veneer::render {
namespace {

// Every code of 10 bits has a pixel. No power of two, so that rows and columns cannot be confused.
constexpr int kWidth = 37;
constexpr int kHeight = 29;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;
static_assert(kPixels >= 1024);

using Codes = std::array<std::uint16_t, 4>;  // a: what the compensate pass keeps there

// All codes of so many bits, in another order for each channel.
std::vector<Codes> all_codes(int bits) {
  const unsigned mask = (1U << static_cast<unsigned>(bits)) - 1U;
  std::vector<Codes> codes(kPixels);
  for (unsigned i = 0; i < kPixels; ++i) {
    codes[i] = {static_cast<std::uint16_t>(i & mask),
                static_cast<std::uint16_t>((i * 5 + 3) & mask),
                static_cast<std::uint16_t>(~i & mask),
                static_cast<std::uint16_t>(i * 97)};
  }
  return codes;
}

class ScanoutPassTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
    context_ = std::make_unique<EglContext>(std::move(*context));
  }

  // What the framebuffer's memory holds after a run, first row first.
  static std::vector<std::uint32_t> words(const std::vector<Codes>& codes,
                                          int code_bits,
                                          GLenum format,
                                          int buffer_bits) {
    auto pass = ScanoutPass::create(code_bits);
    if (!pass) throw std::runtime_error(pass.error().what);
    const GlTexture source = make_texture_2d(GL_RGBA16UI, kWidth, kHeight);
    glTextureSubImage2D(
        source.id(), 0, 0, 0, kWidth, kHeight, GL_RGBA_INTEGER, GL_UNSIGNED_SHORT, codes.data());
    const GlTexture target = make_texture_2d(format, kWidth, kHeight);
    const GlFramebuffer framebuffer = make_framebuffer();
    glNamedFramebufferTexture(framebuffer.id(), GL_COLOR_ATTACHMENT0, target.id(), 0);
    glEnable(GL_DITHER);  // as GL begins
    pass->run(source.id(), framebuffer.id(), buffer_bits, kWidth, kHeight);
    // Of the texture, as no conversion lies between it and the packed words of its own layout.
    std::vector<std::uint32_t> pixels(kPixels);
    glGetTextureImage(
        target.id(),
        0,
        GL_RGBA,
        buffer_bits == 8 ? GL_UNSIGNED_INT_8_8_8_8_REV : GL_UNSIGNED_INT_2_10_10_10_REV,
        static_cast<GLsizei>(pixels.size() * sizeof(pixels[0])),
        pixels.data());
    EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
    return pixels;
  }

  template <class Wanted>
  static void expect(const std::vector<std::uint32_t>& pixels,
                     const std::vector<Codes>& codes,
                     unsigned bits,
                     const Wanted& wanted) {
    const std::uint32_t mask = (1U << bits) - 1U;
    for (std::size_t i = 0; i < kPixels; ++i) {
      for (unsigned channel = 0; channel < 3; ++channel) {
        ASSERT_EQ((pixels[i] >> (channel * bits)) & mask, wanted(codes[i][channel]))
            << "code " << codes[i][channel] << " of channel " << channel << " at pixel " << i;
      }
    }
  }

 private:
  std::unique_ptr<EglContext> context_;
};

TEST_F(ScanoutPassTest, StoresEightBitCodesAsTheyAre) {
  const auto codes = all_codes(8);
  expect(words(codes, 8, GL_RGBA8, 8), codes, 8, [](std::uint16_t code) { return code; });
}

TEST_F(ScanoutPassTest, StoresTenBitCodesAsTheyAre) {
  const auto codes = all_codes(10);
  expect(words(codes, 10, GL_RGB10_A2, 10), codes, 10, [](std::uint16_t code) { return code; });
}

TEST_F(ScanoutPassTest, WidensFewerBitsToTheNearestCode) {
  for (const int bits : {1, 6, 8, 9}) {
    const auto codes = all_codes(bits);
    const double most = std::pow(2, bits) - 1;
    expect(words(codes, bits, GL_RGB10_A2, 10), codes, 10, [&](std::uint16_t code) {
      return static_cast<std::uint32_t>(std::lround(code * 1023.0 / most));
    });
  }
}

// A code that its bits cannot hold is our own mistake; it must not wrap around to something else.
TEST_F(ScanoutPassTest, CutsWhatIsTooLarge) {
  const auto codes = all_codes(10);
  expect(words(codes, 8, GL_RGBA8, 8), codes, 8, [](std::uint16_t code) {
    return std::min<std::uint16_t>(code, 255);
  });
}

}  // namespace
}  // namespace veneer::render
