// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"
#include "btf/interpolated_set.h"
#include "calibration/profile.h"
#include "quality/viewpoints.h"
#include "render/scene.h"

namespace veneer::quality {

/// How far one picture is from another, over pixels and primaries.
struct ScreenError {
  double epsilon = 0;  ///< mean |difference| of linear sRGB over the white, cut to [0, 1], ^(1/2.2)
  double rmse = 0;     ///< likewise, root mean square
  double de00_mean = 0;  ///< CIEDE2000, white = what full drive sends at the reference point
  double de00_p95 = 0;
  double de00_max = 0;
  std::int64_t pixels = 0;
};

/// Errors of one way to draw, over all viewpoints.
struct ScreenErrors {
  /// What the material asks the surface to send, before compensation.
  ScreenError target;
  /// What the surface sends by the profile for the codes that were put out: compensation, gamut and
  /// quantisation included, dither averaged over the pixel's neighbours.
  ScreenError received;
};

struct ScreenReferenceOptions {
  int pixels = 2000;  ///< compared in each view, spread over what is covered
  int rays = 8;       ///< along each side of a pixel; what falls between the texels counts
  [[nodiscard]] Status check() const;
};

/// What the full BTF, interpolated linearly in double precision and averaged over each pixel's
/// footprint, asks for at some pixels of the projector, for every viewpoint and all of the scene's
/// lights. What every way to draw is held against on the screen.
class ScreenReference {
 public:
  /// Errors: those of the renderer; kInvalidOption (nothing is covered from a viewpoint).
  [[nodiscard]] static Result<ScreenReference> make(const render::Scene& scene,
                                                    const calibration::ProjectorProfile& profile,
                                                    const btf::InterpolatedSet& set,
                                                    std::vector<Viewpoint> viewpoints,
                                                    const ScreenReferenceOptions& options,
                                                    Progress& progress);
  ScreenReference(ScreenReference&&) noexcept;
  ~ScreenReference();

  [[nodiscard]] std::span<const Viewpoint> viewpoints() const;

  /// A frame of each viewpoint, as Renderer gives them.
  struct Frame {
    Image<Rgb32f> target;  ///< XYZ in cd/m^2
    Image<Rgb16> codes;
  };
  /// @param frames  one for each viewpoint.
  [[nodiscard]] ScreenErrors errors(std::span<const Frame> frames) const;

 private:
  struct State;
  explicit ScreenReference(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::quality
