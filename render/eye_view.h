// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <optional>

#include "base/image.h"
#include "base/result.h"
#include "btf/material.h"
#include "calibration/profile.h"
#include "render/scene.h"
#include "render/texel_size.h"

namespace veneer::render {

/// How an observer looks at an object that is made of the material: no projector, no compensation.
struct EyeView {
  Eigen::Vector3d eye_in_world{0, 0, 1};  ///< metres
  int width = 800;                        ///< pixels
  int height = 600;
  int samples = 2;  ///< along each side of a pixel, which is their mean; 1 to kMostSamples
  /// Draws every layer of the material as a shell around the mesh, so that the texture's own
  /// contour shows, in place of the material on the mesh. Only for materials with
  /// btf::ModelShader::shells.
  bool shells = false;

  static constexpr int kMostSamples = 8;
  static constexpr int kMostPixels = 16384;  ///< along a side, samples counted: what GL takes
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

struct EyePicture {
  Image<Rgb32f> radiance_xyz;      ///< XYZ in cd/m^2; 0 past the object
  Image<float> hidden;             ///< how much of what is behind it the object hides, 0 to 1
  std::optional<TexelSize> texel;  ///< where shells were drawn, which are as thick as its mean
};

/// The pinhole that sees all of an object from an eye, +y of the world upwards: it looks at the
/// middle of the mesh, and a ball about it that holds the mesh and `beyond_m` more touches nearly
/// the picture's nearer edges. Errors: kInvalidOption (the eye is in that ball).
[[nodiscard]] Result<calibration::ProjectorGeometry> geometry_of_eye(const Scene& scene,
                                                                     const EyeView& view,
                                                                     double beyond_m = 0.0);

/// Draws a scene as it stands (Scene::world_from_object) from an eye. With and without shells a
/// material of layers is seen by the same pinhole. Makes a context of its own.
/// Errors: kInvalidOption (options; shells of a material without layers, or that are higher than
/// the object is wide), kBadFormat (scene), kUnavailable (no GL 4.5).
[[nodiscard]] Result<EyePicture> draw_from_eye(const Scene& scene,
                                               const btf::Material& material,
                                               const EyeView& view);

}  // namespace veneer::render
