// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "btf/fit_region.h"
#include "calibration/profile.h"
#include "render/scene.h"

namespace veneer::quality {

/// One thing that the scene asks of its material: what a point of the surface sends to an eye.
struct Asked {
  btf::Direction view;
  struct Lit {
    btf::Direction light;
    Eigen::Vector3d illuminance_rgb;  ///< lux, on a plane that faces the light
  };
  std::array<Lit, render::kMaxLights> lit;  ///< the first `lights` of them; all above the horizon
  int lights = 0;
  Eigen::Vector2d repeats;  ///< where on the sample: the shader's uv
  Eigen::Vector2d pixel;    ///< of the projector
  double geometry = 1;      ///< cos(theta_p) (r_ref / r)^2
  double vignetting = 1;    ///< at the pixel
  double weight = 1;        ///< how much it is seen: of the solid angle at the eye
};

/// What a scene can ask of a BTF: which (view, light) pairs of the local frame occur on the part of
/// the surface that the projector reaches, for all places of the observer and all lights in their
/// regions, and how often.
struct Reach {
  btf::FitRegion region;               ///< the pairs' density over the measured ones, and the boxes
  double reached_pairs = 0;            ///< part of the measured pairs with any weight, 0 to 1
  double view_theta_max = 0;           ///< radians
  double light_theta_max = 0;          ///< radians
  double below_horizon = 0;            ///< part of what is asked where view or light is below it
  double texels_per_pixel_median = 0;  ///< along a pixel's side; 0: not known
  double texels_per_pixel_p95 = 0;
  /// The object's pose comes from a tracker, so nothing follows from the scene: all is asked.
  bool any_pose = false;
  /// A sample of what is asked, the same each time, whose every beginning fills the whole evenly.
  std::vector<Asked> asked;
};

struct ReachOptions {
  /// Triples (point, eye, lights) that are tried. 1024 to 2^24.
  std::size_t samples = std::size_t{1} << 18U;
  /// Of Reach::asked.
  std::size_t kept = 4096;
  /// As RendererOptions has it: less of the projector's light is no reach.
  double geometry_floor = 0.05;
  [[nodiscard]] Status check() const;
};

/// Samples points of the surface evenly by area, places of the observer and lights in their regions
/// evenly by point_in(), all by one low-discrepancy sequence. A pair weighs as much as it is seen,
/// cos(theta_v) / distance^2 to the eye, whatever the material sends; what lies between measured
/// directions weighs on those that the interpolation (SphericalInterpolator) takes, with the square
/// of its weight for lights beyond the data, which are drawn fainter. That the object hides a point
/// from the projector is found on a coarse raster; that it hides it from the eye or a light is not
/// looked at, so the reach is rather too large.
///
/// The boxes hold all samples, and the corners of the mesh from the edges of the regions, with a
/// margin of what the second half of the samples still added, at least kLeastMargin.
///
/// Errors: kInvalidOption (nothing of the object is lit by the projector; no observer region; no
/// light and eye above any horizon).
[[nodiscard]] Result<Reach> find_reach(const render::Scene& scene,
                                       const calibration::ProjectorProfile& profile,
                                       const btf::SampleSetInfo& set,
                                       Progress& progress,
                                       const ReachOptions& options = {});

/// On the square of the elevated concentric map: about one degree.
inline constexpr double kLeastMargin = 0.005;

}  // namespace veneer::quality
