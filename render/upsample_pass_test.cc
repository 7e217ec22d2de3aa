// SPDX-License-Identifier: Apache-2.0
#include "render/upsample_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "render/drawing.h"
#include "render/egl_context.h"

namespace veneer::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;
using Eigen::Vector4f;

// A half float may be rounded or cut.
constexpr double kHalfStep = 1.0 / 1024;

// Row by row.
struct Picture {
  Vector2i size;
  std::vector<Vector4f> pixels;
  [[nodiscard]] const Vector4f& at(int x, int y) const {
    return pixels[static_cast<std::size_t>(y * size.x() + x)];
  }
};

class UpsamplePassTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
    context_.emplace(std::move(*context));
  }

  using Texel = std::function<Vector4f(int x, int y)>;
  static Picture made(const Vector2i& size, const Texel& texel) {
    Picture picture{size, {}};
    for (int y = 0; y < size.y(); ++y)
      for (int x = 0; x < size.x(); ++x) picture.pixels.push_back(texel(x, y));
    return picture;
  }
  // What a smaller picture is on a raster of the size `full`.
  static Picture upsampled(const Picture& small, const Vector2i& full) {
    const auto from = DrawTarget::create(small.size).value();
    const auto to = DrawTarget::create(full).value();
    glTextureSubImage2D(from.colour(),
                        0,
                        0,
                        0,
                        small.size.x(),
                        small.size.y(),
                        GL_RGBA,
                        GL_FLOAT,
                        small.pixels.data());
    UpsamplePass::create().value().run(from, to);
    Picture picture{full, std::vector<Vector4f>(static_cast<std::size_t>(full.prod()))};
    glBindFramebuffer(GL_READ_FRAMEBUFFER, to.framebuffer());
    glReadPixels(0, 0, full.x(), full.y(), GL_RGBA, GL_FLOAT, picture.pixels.data());
    return picture;
  }

 private:
  std::optional<EglContext> context_;
};

TEST(ScaledRaster, IsTheNextWholeNumberOfPixels) {
  EXPECT_EQ(scaled_raster({1024, 768}, 1.0), Vector2i(1024, 768));
  EXPECT_EQ(scaled_raster({1024, 768}, 0.5), Vector2i(512, 384));
  EXPECT_EQ(scaled_raster({101, 7}, 0.5), Vector2i(51, 4));
  EXPECT_EQ(scaled_raster({1, 1}, DrawingOptions::kLeastScale), Vector2i(1, 1));
  // 100 * 0.55 is just above 55 in double precision.
  EXPECT_EQ(scaled_raster({100, 100}, 0.55), Vector2i(55, 55));
}

TEST_F(UpsamplePassTest, IsExactOnALinearRamp) {
  const Vector2i full(101, 64);
  for (const double scale : {0.25, 0.5, 0.71, 0.99}) {
    const Vector2i size = scaled_raster(full, scale);
    const Vector2d ratio = full.cast<double>().cwiseQuotient(size.cast<double>());
    // Of a place in pixels of the projector; up to 4, as small as half floats do not notice.
    const auto ramp = [](const Vector2d& place) {
      return Eigen::Vector4d(1 + place.x() / 64, 1 + place.y() / 64, 2, 1 + place.sum() / 128);
    };
    const Picture small = made(size, [&](int x, int y) {
      return Vector4f(ramp(ratio.cwiseProduct(Vector2d(x + 0.5, y + 0.5))).cast<float>());
    });
    const Picture shown = upsampled(small, full);
    int compared = 0;
    for (int y = 0; y < full.y(); ++y) {
      for (int x = 0; x < full.x(); ++x) {
        const Vector2d place(x + 0.5, y + 0.5);
        // Beyond the outermost centres there is nothing to go between.
        if ((place.array() < ratio.array() / 2).any() ||
            (place.array() > full.cast<double>().array() - ratio.array() / 2).any())
          continue;
        const Eigen::Vector4d wanted = ramp(place);
        // Both what is read and what is stored.
        ASSERT_LE((shown.at(x, y).cast<double>() - wanted).cwiseAbs().maxCoeff(),
                  2 * kHalfStep * wanted.maxCoeff())
            << scale << ": " << x << ", " << y << ": " << shown.at(x, y).transpose();
        ++compared;
      }
    }
    EXPECT_GT(compared, full.prod() * 9 / 10);
  }
}

// On a disc of one colour all pixels have this colour, however they lie to its edge, and the
// nearest pixel says whether there is any.
TEST_F(UpsamplePassTest, EdgesDoNotDarken) {
  const Vector2i full(90, 70);
  const Vector4f colour(12, 8, 0.5F, 0.75F);
  const Vector4f nothing(0, 0, 0, 0);
  for (const double scale : {0.25, 0.5, 0.8}) {
    const Picture small = made(scaled_raster(full, scale), [&](int x, int y) {
      const Vector2d place(x + 0.5, y + 0.5);
      return (place - 0.5 * scale * full.cast<double>()).norm() < 25 * scale ? colour : nothing;
    });
    const Picture shown = upsampled(small, full);
    int covered = 0;
    for (int y = 0; y < full.y(); ++y) {
      for (int x = 0; x < full.x(); ++x) {
        const int near_x = static_cast<int>((x + 0.5) * small.size.x() / full.x());
        const int near_y = static_cast<int>((y + 0.5) * small.size.y() / full.y());
        const Vector4f wanted = small.at(near_x, near_y);
        covered += wanted != nothing ? 1 : 0;
        ASSERT_LE((shown.at(x, y) - wanted).cwiseAbs().maxCoeff(), kHalfStep * wanted.maxCoeff())
            << scale << ": " << x << ", " << y << ": " << shown.at(x, y).transpose();
      }
    }
    EXPECT_GT(covered, 1500);
    EXPECT_LT(covered, full.prod() / 2);
  }
}

// Compensation shows a fault dark; here none may turn into light, nor spread beyond its neighbours.
TEST_F(UpsamplePassTest, AFaultStaysAFault) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  const Vector2i size(16, 12);
  for (const Vector4f& fault : {Vector4f(kNan, 1, 1, 1),
                                Vector4f(1, 1, kInf, 1),
                                Vector4f(1, 1, 1, kNan),
                                Vector4f(1, 1, 1, kInf)}) {
    const Picture small =
        made(size, [&](int x, int y) { return x == 7 && y == 5 ? fault : Vector4f(1, 1, 1, 1); });
    const Picture shown = upsampled(small, 2 * size);
    for (int y = 0; y < 2 * size.y(); ++y) {
      for (int x = 0; x < 2 * size.x(); ++x) {
        const bool reached = std::abs(x - 14.5) < 2 && std::abs(y - 10.5) < 2;
        ASSERT_EQ(shown.at(x, y).allFinite(), !reached) << x << ", " << y;
      }
    }
  }
}

}  // namespace
}  // namespace veneer::render
