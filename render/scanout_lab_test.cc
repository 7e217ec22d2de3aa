// SPDX-License-Identifier: Apache-2.0
// Drawing into a display's own buffers. For the kernel lab alone (./dev lab), which has a display.
#include <drm_fourcc.h>
#include <fcntl.h>
#include <gbm.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "render/internal_testing.h"
#include "render/renderer.h"

namespace veneer::render {
namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 64;
constexpr char kCard[] = "/dev/dri/card0";

class ScanoutLab : public ::testing::Test {
 protected:
  void SetUp() override {
    card_ = ::open(kCard, O_RDWR | O_CLOEXEC);
    ASSERT_GE(card_, 0) << kCard << " is missing: load virtio_gpu";
    device_ = gbm_create_device(card_);
    ASSERT_NE(device_, nullptr);
    scanout_.gbm_device = device_;
  }
  void TearDown() override {
    for (const DmaBuffer& buffer : scanout_.buffers) ::close(buffer.descriptor);
    for (gbm_bo* object : objects_) gbm_bo_destroy(object);
    if (device_ != nullptr) gbm_device_destroy(device_);
    if (card_ >= 0) ::close(card_);
  }

  // False where the display has none of this format.
  bool add_buffer(std::uint32_t format) {
    gbm_bo* object =
        gbm_bo_create(device_, kWidth, kHeight, format, GBM_BO_USE_SCANOUT | GBM_BO_USE_RENDERING);
    if (object == nullptr) return false;
    objects_.push_back(object);
    scanout_.buffers.push_back({gbm_bo_get_fd(object),
                                kWidth,
                                kHeight,
                                format,
                                gbm_bo_get_stride(object),
                                gbm_bo_get_offset(object, 0),
                                gbm_bo_get_modifier(object)});
    return scanout_.buffers.back().descriptor >= 0;
  }

  [[nodiscard]] Result<std::unique_ptr<Renderer>> make(int bits, int width = kWidth) const {
    Scene scene;
    scene.mesh = *load_mesh("sphere");
    scene.lights = {DirectionalLight{Eigen::Vector3d(0.3, 0.2, 1).normalized(),
                                     Eigen::Vector3d::Constant(150.0)}};
    return Renderer::create(
        scene,
        one_level(ShaderMaterial("return vec3(0.9, 0.5 + 0.5 * uv.y, uv.x) * light.z;")),
        example_profile(width, kHeight, bits),
        {},
        &scanout_);
  }

  // What the display would scan out of a buffer: row after row, from the first in memory.
  std::vector<std::uint32_t> memory(std::size_t buffer) {
    std::uint32_t stride = 0;
    void* mapping = nullptr;
    const void* mapped = gbm_bo_map(
        objects_[buffer], 0, 0, kWidth, kHeight, GBM_BO_TRANSFER_READ, &stride, &mapping);
    std::vector<std::uint32_t> words;
    if (mapped == nullptr) return words;
    for (int y = 0; y < kHeight; ++y) {
      const auto* row = reinterpret_cast<const std::uint32_t*>(static_cast<const char*>(mapped) +
                                                               std::size_t{stride} * y);
      words.insert(words.end(), row, row + kWidth);
    }
    gbm_bo_unmap(objects_[buffer], mapping);
    return words;
  }

  void expect_codes_in_buffers(int code_bits, int buffer_bits) {
    auto created = make(code_bits);
    ASSERT_TRUE(created) << created.error().what;
    Renderer& renderer = **created;
    std::printf("renderer: %s\n", renderer.description().c_str());
    const double most = std::pow(2, buffer_bits) - 1;
    const double most_code = std::pow(2, code_bits) - 1;
    for (std::size_t buffer = 0; buffer < objects_.size(); ++buffer) {
      FrameInput input{
          {0.1, 0.1 * static_cast<double>(buffer), 1}, {}, static_cast<std::uint32_t>(buffer)};
      renderer.draw(input);
      renderer.draw_to_scanout(buffer);
      renderer.finish();
      Image<Rgb16> codes(kWidth, kHeight);
      renderer.read_codes(codes.view());
      const auto words = memory(buffer);
      ASSERT_EQ(words.size(), std::size_t{kWidth} * kHeight) << "the buffer cannot be mapped";
      std::size_t lit = 0;
      for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
          std::uint32_t wanted = 0;  // red in the highest bits
          for (const std::uint16_t code : codes(x, y))
            wanted = wanted << static_cast<unsigned>(buffer_bits) |
                     static_cast<std::uint32_t>(std::lround(code * most / most_code));
          const std::uint32_t word = words[static_cast<std::size_t>(y) * kWidth + x];
          const std::uint32_t mask = (1U << static_cast<unsigned>(3 * buffer_bits)) - 1U;
          ASSERT_EQ(word & mask, wanted) << x << ", " << y << " of buffer " << buffer;
          lit += wanted != 0 ? 1 : 0;
        }
      EXPECT_GT(lit, std::size_t{200});
    }
  }

  Scanout scanout_;
  std::vector<gbm_bo*> objects_;
  gbm_device* device_ = nullptr;
  int card_ = -1;
};

TEST_F(ScanoutLab, EightBitCodesLieInTheBuffersAsTheyAre) {
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(add_buffer(DRM_FORMAT_XRGB8888));
  expect_codes_in_buffers(8, 8);
}

TEST_F(ScanoutLab, TenBitBuffersTakeTenAndEightBitCodes) {
  if (!add_buffer(DRM_FORMAT_XRGB2101010)) GTEST_SKIP() << "no buffers of 10 bits here";
  expect_codes_in_buffers(10, 10);
  expect_codes_in_buffers(8, 10);
}

TEST_F(ScanoutLab, BuffersThatDoNotSuitAreRefused) {
  ASSERT_TRUE(add_buffer(DRM_FORMAT_XRGB8888));
  EXPECT_EQ(make(8, kWidth + 1).error().code, Errc::kInvalidOption);
  EXPECT_EQ(make(10).error().code, Errc::kInvalidOption);
  scanout_.buffers[0].format = DRM_FORMAT_RGB565;
  EXPECT_EQ(make(8).error().code, Errc::kUnavailable);
  scanout_.buffers[0].format = DRM_FORMAT_XRGB8888;
  const int descriptor = std::exchange(scanout_.buffers[0].descriptor, -1);
  EXPECT_EQ(make(8).error().code, Errc::kUnavailable);
  scanout_.buffers[0].descriptor = descriptor;
  EXPECT_TRUE(make(8));
}

// The device outlives the renderers on it, and gives its display again.
TEST_F(ScanoutLab, RenderersOnTheDeviceComeAndGo) {
  ASSERT_TRUE(add_buffer(DRM_FORMAT_XRGB8888));
  for (int i = 0; i < 2; ++i) {
    SCOPED_TRACE(i);
    expect_codes_in_buffers(8, 8);
  }
}

}  // namespace
}  // namespace veneer::render
