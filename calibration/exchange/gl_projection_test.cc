// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/gl_projection.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "calibration/internal_profile_testing.h"

namespace veneer::calibration {
namespace {

/// Where GL draws: pixels from the left and from the top, and depth, of a viewport of the raster.
Eigen::Vector3d window_of(const Eigen::Vector4d& clip, const ProjectorGeometry& g) {
  const Eigen::Vector3d ndc = clip.head<3>() / clip.w();
  return {(ndc.x() + 1) / 2 * g.width, g.height - (ndc.y() + 1) / 2 * g.height, ndc.z()};
}

constexpr double kPixelTolerance = 1e-9;  // double precision over a raster of a thousand

TEST(GlProjection, APointLandsOnThePinholesPixel) {
  const ProjectorGeometry g = example_geometry();
  const auto veneer = gl_projection(g, 0.1, 10, EyeAxes::kVeneer);
  const auto open_gl = gl_projection(g, 0.1, 10, EyeAxes::kOpenGl);
  ASSERT_TRUE(veneer && open_gl);
  Pcg32 random(8);
  for (int i = 0; i < 500; ++i) {
    const auto uniform = [&] { return 2 * random.uniform() - 1; };
    const Eigen::Vector3d p(uniform(), uniform(), 0.1 + 4.95 * (uniform() + 1));
    const double u = g.fx * p.x() / p.z() + g.cx;
    const double v = g.fy * p.y() / p.z() + g.cy;
    const Eigen::Vector3d a = window_of(*veneer * p.homogeneous(), g);
    const Eigen::Vector3d b = window_of(*open_gl * Eigen::Vector4d(p.x(), -p.y(), -p.z(), 1), g);
    const double tolerance = kPixelTolerance * std::max(1.0, std::abs(u) + std::abs(v));
    EXPECT_NEAR(a.x(), u, tolerance) << p.transpose();
    EXPECT_NEAR(a.y(), v, tolerance) << p.transpose();
    EXPECT_LT((a - b).norm(), tolerance) << p.transpose();
    EXPECT_LE(std::abs(a.z()), 1 + kPixelTolerance);
  }
}

TEST(GlProjection, NearAndFarAreTheEndsOfDepth) {
  const auto p = gl_projection(example_geometry(), 0.25, 8, EyeAxes::kVeneer);
  ASSERT_TRUE(p);
  EXPECT_NEAR(
      window_of(*p * Eigen::Vector4d(0.1, 0.2, 0.25, 1), example_geometry()).z(), -1, 1e-12);
  EXPECT_NEAR(window_of(*p * Eigen::Vector4d(0.1, 0.2, 8, 1), example_geometry()).z(), 1, 1e-12);
}

TEST(GlProjection, WhatIsBehindIsClipped) {
  const auto p = gl_projection(example_geometry(), 0.25, 8, EyeAxes::kVeneer);
  ASSERT_TRUE(p);
  EXPECT_LT((*p * Eigen::Vector4d(0, 0, -1, 1)).w(), 0);
}

TEST(GlProjection, TheFileTakesAPointOfTheWorldToItsPixel) {
  const ProjectorGeometry g = example_geometry();
  const TemporaryFolder folder;
  ASSERT_TRUE(write_gl_projection(folder.path() / "gl.json", g, 0.1, 10));
  const auto text = read_text(folder.path() / "gl.json");
  ASSERT_TRUE(text);
  const auto json = nlohmann::json::parse(*text);
  const auto matrix = [&](const char* name) {
    const auto values = json.at(name).get<std::vector<double>>();
    return Eigen::Matrix4d(Eigen::Map<const Eigen::Matrix4d>(values.data()));
  };
  const Eigen::Vector3d in_projector(0.2, -0.3, 1.5);
  const Eigen::Vector3d in_world = g.world_from_projector * in_projector;
  const Eigen::Vector3d window =
      window_of(matrix("projection") * matrix("view") * in_world.homogeneous(), g);
  EXPECT_NEAR(window.x(), g.fx * 0.2 / 1.5 + g.cx, kPixelTolerance);
  EXPECT_NEAR(window.y(), g.fy * -0.3 / 1.5 + g.cy, kPixelTolerance);
  EXPECT_EQ(json.at("width"), 1280);
}

TEST(GlProjection, WhatMakesNoMatrixIsRefused) {
  const double nan = std::nan("");
  EXPECT_FALSE(gl_projection(example_geometry(), 0, 1));
  EXPECT_FALSE(gl_projection(example_geometry(), 1, 1));
  EXPECT_FALSE(gl_projection(example_geometry(), 0.1, INFINITY));
  EXPECT_FALSE(gl_projection(example_geometry(), nan, 1));
  EXPECT_FALSE(gl_projection(example_geometry(), 0.1, nan));
  ProjectorGeometry g = example_geometry();
  g.fx = 0;
  EXPECT_FALSE(gl_projection(g, 0.1, 1));
  g = example_geometry();
  g.cy = nan;
  EXPECT_FALSE(gl_projection(g, 0.1, 1));
  g = example_geometry();
  g.width = 0;
  EXPECT_FALSE(gl_projection(g, 0.1, 1));
}

}  // namespace
}  // namespace veneer::calibration
