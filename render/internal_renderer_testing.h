// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/colour.h"
#include "render/egl_context.h"
#include "render/internal_testing.h"
#include "render/renderer.h"

namespace veneer::render {

/// Draws scenes for example_profile(), and says where a pixel's ray meets the plate, by hand.
class RendererTest : public ::testing::Test {
 protected:
  static constexpr int kWidth = 160;
  static constexpr int kHeight = 120;
  static constexpr double kPi = std::numbers::pi;
  /// The target is stored in half floats, rounded or cut: at most one step of 2^-10 relative per
  /// component of XYZ, which the matrix back to RGB widens about fourfold.
  static constexpr double kHalfFloatTolerance = 4e-3;

  void SetUp() override {
    const auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
  }

  static Scene scene_of(const char* mesh, const Light& light) {
    Scene scene;
    scene.mesh = *load_mesh(mesh);
    scene.lights = {light};
    return scene;
  }
  static Scene plate_scene() {
    // pi lux on every channel: the luminance drawn is the sample itself.
    return scene_of("plate",
                    DirectionalLight{Eigen::Vector3d(0.3, 0.5, 0.8).normalized(),
                                     Eigen::Vector3d::Constant(kPi)});
  }

  static FrameInput tilted_frame() {
    FrameInput input;
    input.eye_in_world = {-0.4, 0.3, 0.9};
    input.world_from_object.rotation = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()) *
                                       Eigen::AngleAxisd(-0.4, Eigen::Vector3d::UnitY()) *
                                       Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ());
    input.world_from_object.translation = {0.02, -0.03, 0.05};
    return input;
  }

  /// The projector's ray through a point of its raster, in the object's frame, by hand.
  struct Ray {
    Eigen::Vector3d from;
    Eigen::Vector3d along;
  };
  [[nodiscard]] Ray ray_in_object(const FrameInput& input, double x, double y) const {
    const calibration::ProjectorGeometry& g = profile_.geometry;
    const RigidTransform object_from_projector =
        input.world_from_object.inverse() * g.world_from_projector;
    return {object_from_projector.translation,
            object_from_projector.rotation *
                Eigen::Vector3d((x - g.cx) / g.fx, (y - g.cy) / g.fy, 1.0)};
  }

  /// The point of the plate under a point of the raster, in the object's frame; none off the plate.
  [[nodiscard]] std::optional<Eigen::Vector3d> point_on_plate(const FrameInput& input,
                                                              double x,
                                                              double y) const {
    const Ray ray = ray_in_object(input, x, y);
    const Eigen::Vector3d point = ray.from - ray.along * (ray.from.z() / ray.along.z());
    if (std::abs(point.x()) > 0.1 || std::abs(point.y()) > 0.1) return std::nullopt;
    return point;
  }

  [[nodiscard]] std::unique_ptr<Renderer> make(const Scene& scene,
                                               const btf::Material& material,
                                               const DrawingOptions& drawing = {},
                                               const RendererOptions& options = {}) const {
    auto renderer = Renderer::create(scene, one_level(material, drawing), profile_, options);
    if (!renderer) throw std::runtime_error(renderer.error().what);
    return std::move(*renderer);
  }

  /// Draws the plate in a material that shows three numbers as linear RGB, and compares them with
  /// `expected(point in the object's frame)` wherever a pixel is safely on the plate.
  template <class Expected>
  void expect_everywhere(const Scene& scene,
                         const btf::Material& material,
                         const Expected& expected) {
    const FrameInput input = tilted_frame();
    const auto renderer = make(scene, material);
    renderer->draw(input);
    Image<Rgb32f> target(kWidth, kHeight);
    renderer->read_target(target.view());
    int compared = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto point = point_on_plate(input, x + 0.5, y + 0.5);
        const bool drawn = target(x, y).norm() > 0;
        if (!point) continue;
        if (!drawn) {  // only the outermost pixels may differ, by rounding
          EXPECT_GT(std::max(std::abs(point->x()), std::abs(point->y())), 0.0995) << x << ", " << y;
          continue;
        }
        const Eigen::Vector3d shown = srgb_from_xyz() * target(x, y).cast<double>();
        const Eigen::Vector3d wanted = expected(*point);
        ASSERT_LT((shown - wanted).norm(), kHalfFloatTolerance * std::max(1.0, wanted.norm()))
            << "pixel " << x << ", " << y << ": " << shown.transpose() << " instead of "
            << wanted.transpose();
        ++compared;
      }
    }
    EXPECT_GT(compared, 500);
  }

  calibration::ProjectorProfile profile_ = example_profile(kWidth, kHeight, 8);
};

}  // namespace veneer::render
