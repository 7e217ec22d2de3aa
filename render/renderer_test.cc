// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "base/colour.h"
#include "render/internal_testing.h"

namespace veneer::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr double kPi = std::numbers::pi;
// The target is stored in half floats, rounded or cut: at most one step of 2^-10 relative per
// component of XYZ, which the matrix back to RGB widens about fourfold.
constexpr double kHalfFloatTolerance = 4e-3;

Scene plate_scene() {
  Scene scene;
  scene.mesh = *load_mesh("plate");
  // pi lux on every channel: the luminance drawn is the sample itself.
  scene.lights = {DirectionalLight{Vector3d(0.3, 0.5, 0.8).normalized(), Vector3d::Constant(kPi)}};
  return scene;
}

FrameInput tilted_frame() {
  FrameInput input;
  input.eye_in_world = {-0.4, 0.3, 0.9};
  input.world_from_object.rotation = Eigen::AngleAxisd(0.3, Vector3d::UnitX()) *
                                     Eigen::AngleAxisd(-0.4, Vector3d::UnitY()) *
                                     Eigen::AngleAxisd(0.2, Vector3d::UnitZ());
  input.world_from_object.translation = {0.02, -0.03, 0.05};
  return input;
}

// A point of the plate under a pixel's centre, in the object's frame, by hand; none off the plate.
std::optional<Vector3d> point_on_plate(const calibration::ProjectorGeometry& g,
                                       const FrameInput& input,
                                       double x,
                                       double y) {
  const RigidTransform object_from_projector =
      input.world_from_object.inverse() * g.world_from_projector;
  const Vector3d from = object_from_projector.translation;
  const Vector3d ray =
      object_from_projector.rotation * Vector3d((x - g.cx) / g.fx, (y - g.cy) / g.fy, 1.0);
  const Vector3d point = from - ray * (from.z() / ray.z());
  if (std::abs(point.x()) > 0.1 || std::abs(point.y()) > 0.1) return std::nullopt;
  return point;
}

class RendererTest : public ::testing::Test {
 protected:
  // A renderer for the material, or null (and a skip) where there is no GL.
  std::unique_ptr<Renderer> make(const Scene& scene,
                                 const btf::Material& material,
                                 const RendererOptions& options = {}) {
    auto renderer = Renderer::create(scene, material, profile_, options);
    if (!renderer) {
      EXPECT_EQ(renderer.error().code, Errc::kUnavailable) << renderer.error().what;
      return nullptr;
    }
    return std::move(*renderer);
  }

  // Draws the plate in a material that shows three numbers as linear RGB, and compares them with
  // `expected(point in the object's frame)` wherever a pixel is safely on the plate.
  template <class Expected>
  void expect_everywhere(const std::string& body, const Expected& expected) {
    const FrameInput input = tilted_frame();
    const auto renderer = make(plate_scene(), ShaderMaterial(body));
    if (renderer == nullptr) GTEST_SKIP() << "no OpenGL 4.5 here";
    renderer->draw(input);
    Image<Rgb32f> target(kWidth, kHeight);
    renderer->read_target(target.view());
    int compared = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto point = point_on_plate(profile_.geometry, input, x + 0.5, y + 0.5);
        const bool drawn = target(x, y).norm() > 0;
        if (!point) continue;
        if (!drawn) {  // only the outermost pixels may differ, by rounding
          EXPECT_GT(std::max(std::abs(point->x()), std::abs(point->y())), 0.0995) << x << ", " << y;
          continue;
        }
        const Vector3d shown = srgb_from_xyz() * target(x, y).cast<double>();
        const Vector3d wanted = expected(*point);
        ASSERT_LT((shown - wanted).norm(), kHalfFloatTolerance)
            << "pixel " << x << ", " << y << ": " << shown.transpose() << " instead of "
            << wanted.transpose();
        ++compared;
      }
    }
    EXPECT_GT(compared, 500);
  }

  calibration::ProjectorProfile profile_ = example_profile(kWidth, kHeight, 8);
};

TEST_F(RendererTest, PutsTexturesWhereProjectionByHandPutsThem) {
  expect_everywhere("return vec3(uv, 0.5);", [](const Vector3d& point) {
    return Vector3d(point.x() / 0.2 + 0.5, 0.5 - point.y() / 0.2, 0.5);
  });
}

TEST_F(RendererTest, GivesModelsTheViewInTheLocalFrame) {
  expect_everywhere("return 0.5 + 0.5 * view;", [](const Vector3d& point) -> Vector3d {
    const FrameInput input = tilted_frame();
    const Vector3d eye = input.world_from_object.inverse() * input.eye_in_world;
    return Vector3d::Constant(0.5) + 0.5 * (eye - point).normalized();
  });
}

TEST_F(RendererTest, GivesModelsTheLightInTheLocalFrame) {
  expect_everywhere("return 0.5 + 0.5 * light;", [](const Vector3d&) -> Vector3d {
    const Vector3d light = std::get<DirectionalLight>(plate_scene().lights[0]).direction_to_light;
    return Vector3d::Constant(0.5) +
           0.5 * (tilted_frame().world_from_object.rotation.conjugate() * light);
  });
}

}  // namespace
}  // namespace veneer::render
