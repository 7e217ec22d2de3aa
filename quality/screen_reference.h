// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/colour.h"
#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"
#include "btf/interpolated_set.h"
#include "calibration/profile.h"
#include "quality/viewpoints.h"
#include "render/drawing.h"
#include "render/scene.h"

namespace veneer::quality {

/// How far one picture is from another, over pixels and primaries. Where a value is no number, all
/// figures are NaN.
struct ScreenError {
  /// Mean |difference| of linear sRGB over the luminance of the white, cut to [0, 1], ^(1/2.2).
  double epsilon = 0;
  double rmse = 0;       ///< likewise, root mean square
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
  /// quantisation included, dither averaged over frames.
  ScreenError received;
};

struct ScreenReferenceOptions {
  int pixels = 2000;  ///< compared in each view, spread over what is covered. 1 to 10'000'000.
  /// Along each side of a pixel; what falls between the texels counts. 1 asks for the texel at the
  /// pixel's centre alone. 1 to 32.
  int rays = 8;
  /// Frames of one viewpoint whose light is averaged, each with another dither. 1 to 64.
  int dither_seeds = 8;
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

/// What the full BTF, interpolated linearly in double precision and averaged over each pixel's
/// footprint, asks for at some pixels of the projector, for every viewpoint and all of the scene's
/// lights. What every way to draw is held against on the screen.
///
/// Geometry (texture coordinates, local directions to eye and lights, G) is read back from the GPU,
/// from the shader functions that draw: what is measured is the material and what becomes of it,
/// not the mesh. The footprint is the parallelogram that the pixel covers in texture coordinates;
/// its directions are those of the centre. A light below the horizon asks for nothing.
///
/// Dither is noise of one code around what was meant. The mean over neighbouring pixels would take
/// the material's own change from texel to texel for an error; so the same frame is put out under
/// several dither seeds, and the light of their codes averaged at every pixel by itself. The
/// thresholds of consecutive seeds are a golden-ratio sequence (dither.h), whose mean over 8 is
/// within 0.18 of a code's step of what was meant (0.06 on the root mean square).
class ScreenReference {
 public:
  /// Errors: those of the renderer; kInvalidOption (nothing can be compared from a viewpoint).
  [[nodiscard]] static Result<ScreenReference> make(const render::Scene& scene,
                                                    const calibration::ProjectorProfile& profile,
                                                    const btf::InterpolatedSet& set,
                                                    std::vector<Viewpoint> viewpoints,
                                                    const ScreenReferenceOptions& options,
                                                    Progress& progress);
  ScreenReference(ScreenReference&&) noexcept;
  ScreenReference& operator=(ScreenReference&&) noexcept;
  ~ScreenReference();

  [[nodiscard]] std::span<const Viewpoint> viewpoints() const;
  /// As the options had it.
  [[nodiscard]] int dither_seeds() const;

  /// Pixels over all viewpoints: those that are compared, and those looked at and left out.
  struct Counts {
    std::int64_t compared = 0;
    std::int64_t at_edges = 0;      ///< silhouettes and seams, where a pixel sees two places
    std::int64_t out_of_reach = 0;  ///< G under RendererOptions::geometry_floor: stay black
    std::int64_t unseen = 0;        ///< turned away from the eye
    std::int64_t unsound = 0;       ///< where the mesh gives no direction
  };
  [[nodiscard]] const Counts& counts() const;

  /// What is compared from a viewpoint: pixels, row * width + column, and what the full BTF asks
  /// for at each, XYZ in cd/m^2.
  [[nodiscard]] std::span<const int> pixels(std::size_t viewpoint) const;
  [[nodiscard]] std::span<const Xyz> wanted(std::size_t viewpoint) const;

  /// What was shown from one viewpoint at its compared pixels, XYZ in cd/m^2.
  struct Frame {
    std::vector<Xyz> target;
    std::vector<Xyz> received;
  };
  /// Takes out of whole frames what is compared.
  /// @param target  as Renderer::read_target gives it.
  /// @param codes   of one dither seed or several, at least one; all of the profile's raster
  ///                (checked). Their light is averaged: A [ G (M (t + rho) + k) + E ].
  [[nodiscard]] Frame frame(std::size_t viewpoint,
                            const Image<Rgb32f>& target,
                            std::span<const Image<Rgb16>> codes) const;
  /// @param frames  one for each viewpoint (checked).
  [[nodiscard]] ScreenErrors errors(std::span<const Frame> frames) const;

 private:
  struct State;
  explicit ScreenReference(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Draws a level from every viewpoint of the reference, as the renderer does by default, and
/// compares. Scene and profile are those that the reference was made for. Errors: those of the
/// renderer.
[[nodiscard]] Result<ScreenErrors> measure_on_screen(const ScreenReference& reference,
                                                     const render::Scene& scene,
                                                     const calibration::ProjectorProfile& profile,
                                                     const render::Level& level);

}  // namespace veneer::quality
