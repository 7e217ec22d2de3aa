// SPDX-License-Identifier: Apache-2.0
#pragma once

// For the tests of render/, and of quality/, which measures what it draws.

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "btf/material.h"
#include "calibration/profile.h"
#include "render/drawing.h"

namespace veneer::render {

/// A material that is nothing but a shader.
class ShaderMaterial : public btf::Material {
 public:
  explicit ShaderMaterial(btf::ModelShader shader) : shader_(std::move(shader)) {}
  /// @param body  of `vec3 btf_radiance(vec2 uv, vec3 view, vec3 light)`.
  explicit ShaderMaterial(const std::string& body, int width = 1, int height = 1)
      : width_(width), height_(height) {
    shader_.source = "vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {" + body + "}";
  }
  [[nodiscard]] std::string_view model() const override { return "shader"; }
  [[nodiscard]] int width() const override { return width_; }
  [[nodiscard]] int height() const override { return height_; }
  [[nodiscard]] const btf::DirectionSet& views() const override { return none_; }
  [[nodiscard]] const btf::DirectionSet& lights() const override { return none_; }
  void reconstruct(int /*texel*/, std::span<float> /*rgb*/) const override {}
  [[nodiscard]] Eigen::Vector3d radiance(int /*texel*/,
                                         const btf::Direction& /*view*/,
                                         const btf::Direction& /*light*/) const override {
    return Eigen::Vector3d::Zero();
  }
  [[nodiscard]] btf::ModelShader shader() const override { return shader_; }
  [[nodiscard]] double values_per_texel() const override { return 0.0; }
  [[nodiscard]] Contents contents() const override { return {}; }

 private:
  int width_ = 1;
  int height_ = 1;
  btf::ModelShader shader_;
  btf::DirectionSet none_;
};

/// For renderers that draw in one way.
inline std::vector<Level> one_level(const btf::Material& material,
                                    const DrawingOptions& drawing = {}) {
  return {{&material, drawing}};
}

/// A plausible machine: sRGB-like primaries of 200 cd/m^2 white with crosstalk, bluish black, a
/// warm surface whose A is no diagonal, ambient light, vignetting, three different tone curves, and
/// a principal point far off centre. It stands 1 m from the origin on +z and looks at it.
inline calibration::ProjectorProfile example_profile(int width, int height, int bits) {
  calibration::ProjectorProfile profile;
  auto& g = profile.geometry;
  g.width = width;
  g.height = height;
  g.fx = 1.5 * width;
  g.fy = 1.45 * width;
  g.cx = 0.52 * width;
  g.cy = 0.61 * height;
  g.world_from_projector = look_at({0.1, 0.2, 1.0}, {0, 0, 0}, {0, 1, 0});
  profile.bits = bits;
  const std::size_t size = std::size_t{1} << static_cast<unsigned>(bits);
  constexpr double kExponents[] = {2.2, 2.4, 1.9};
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < size; ++i)
      profile.tone_curves[c].push_back(
          std::pow(static_cast<double>(i) / static_cast<double>(size - 1), kExponents[c]));
  }
  profile.primaries = 200.0 * (Eigen::Matrix3d() << 0.42,
                               0.34,
                               0.19,  //
                               0.22,
                               0.70,
                               0.08,  //
                               0.03,
                               0.11,
                               0.95)
                                  .finished();
  profile.black = {0.10, 0.10, 0.16};
  profile.reference_distance_m = 1.1;
  profile.vignetting = Image<float>(3, 2);
  const float falloff[] = {0.8F, 0.95F, 0.85F, 0.75F, 0.9F, 0.7F};
  std::copy(std::begin(falloff), std::end(falloff), profile.vignetting.pixels().begin());
  profile.surface << 0.80, 0.03, -0.01,  //
      0.02, 0.75, 0.01,                  //
      0.00, 0.02, 0.60;
  profile.ambient = {0.9, 1.0, 0.8};
  return profile;
}

/// A projector with a white segment of a quarter, crosstalk and primaries that drift, which leaves
/// the cone of the primaries: rho of ProjectorProfile::residual.
inline calibration::ColourResidual example_residual() {
  return calibration::ColourResidual::sampled(17, [](const Eigen::Vector3d& t) -> Eigen::Vector3d {
    const Eigen::Vector3d segment = t.minCoeff() * Eigen::Vector3d(0.24, 0.25, 0.27);
    const Eigen::Vector3d crosstalk = -0.05 * t * (t.sum() / 3.0) * (1.0 - t.minCoeff());
    const Eigen::Vector3d drift =
        0.03 * Eigen::Vector3d(t.y() * (1 - t.y()), t.z() * (1 - t.z()), -t.x() * (1 - t.x()));
    return segment + crosstalk + drift;
  });
}

/// A surface whose reflectance varies strongly, by other amounts for each primary.
inline Image<Rgb32f> example_surface_map() {
  Image<Rgb32f> map(7, 5);
  for (int y = 0; y < map.height(); ++y) {
    for (int x = 0; x < map.width(); ++x) {
      map(x, y) = Rgb32f(x % 2 == 0 ? 1.2F : 0.3F,
                         0.15F + 0.2F * static_cast<float>(y),
                         (x + y) % 3 == 0 ? 0.2F : 0.8F);
    }
  }
  return map;
}

}  // namespace veneer::render
