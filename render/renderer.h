// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/image.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "base/scanout.h"
#include "calibration/profile.h"
#include "render/drawing.h"
#include "render/scene.h"

namespace veneer::render {

class PreparedProfile;

struct RendererOptions {
  /// Off: the target's luminance is sent as if projector and surface were ideal (sRGB of the target
  /// over the white of the profile), which is what people do without calibration.
  bool compensate = true;
  bool dither = true;
  /// Below this G a point is out of the projector's reach and stays black. > 0.
  double geometry_floor = 0.05;
  /// Profiles will be exchanged while frames are drawn: what another one may need is compiled at
  /// the start.
  bool exchangeable = false;
  /// No code is sent for which the profile's model says more light than this, cd/m^2 of a perfect
  /// diffuser where G is 1; enforced after all else. 0: no ceiling. A pixel over it keeps its hue.
  double luminance_ceiling = 0;
};

/// What one frame needs to know. Where any of it is no number that single precision holds, or
/// specular_weight or fade is not in [0, 1], the frame is dark.
struct FrameInput {
  Eigen::Vector3d eye_in_world;
  RigidTransform world_from_object;
  std::uint32_t dither_seed = 0;
  /// The share of the material's highlights that is shown, 0 to 1; at 0 only its diffuse part is
  /// left. Highlights tell a wrong eye at once, so they can go while nobody knows where it is.
  /// Does nothing to materials without Material::has_specular_term().
  double specular_weight = 1.0;
  /// Which of the renderer's levels is drawn; it and next_level exist (checked).
  std::size_t level = 0;
  /// The one that takes its place, and how much of the picture is already its own: 0, none, to 1,
  /// all; without effect where the two are the same. In between, tiles of the picture go over one
  /// after another, each once and far from the one before, and only one of the two levels is shaded
  /// in each: whoever changes levels because time is short has none for drawing both, which a mix
  /// of the two would need. A tile shows its whole difference at once, so many frames make the
  /// steps rarer, not smaller. What a level does for the whole frame (transforming vertices,
  /// filling the angular cache, reading what a compute pass evaluates) is done for both, and the
  /// tiles are marked once for each; where their scales differ, the smaller is drawn a pixel beyond
  /// its tiles.
  std::size_t next_level = 0;
  double fade = 0.0;
};

/// What one frame did, read without waiting for the GPU (so it may be of an earlier frame).
struct FrameStatistics {
  std::uint64_t covered_pixels = 0;
  std::uint64_t out_of_gamut_pixels = 0;  ///< of the covered ones, before gamut mapping
  std::uint64_t out_of_reach_pixels = 0;  ///< below the geometry floor
  double gamut_loss_mean =
      0;  ///< mean colour difference dE in IPT x 100 that mapping made, over the covered
  std::uint64_t held_pixels = 0;  ///< brought down to RendererOptions::luminance_ceiling
  std::optional<double> gpu_ms;   ///< GL timer query: draw and compensation
  std::optional<double> draw_ms;  ///< of this, the draw pass
  /// Processor time of the thread that called draw(), in the GL calls that draw: with a software
  /// rasteriser those transform vertices and sort triangles. Nothing where a GPU draws.
  std::optional<double> software_ms;
};

/// Draws a scene's material as the projector must show it. Owns the EGL context and every GL
/// object. Used by one thread at a time: the one that made it, until that calls release(); then by
/// the next that calls anything.
class Renderer {
 public:
  /// @param levels  at least one; all materials stay on the GPU.
  /// @param scanout  the display's buffers, if draw_to_scanout() will be called; borrowed, must
  /// outlive the renderer.
  /// Errors: kUnavailable (no EGL, no GL 4.5, buffers that cannot be imported; says what there is),
  /// kBadFormat, kInvalidOption (also buffers of another size or of fewer bits than the profile).
  [[nodiscard]] static Result<std::unique_ptr<Renderer>> create(
      const Scene& scene,
      std::span<const Level> levels,
      const calibration::ProjectorProfile& profile,
      const RendererOptions& options,
      const Scanout* scanout = nullptr);
  virtual ~Renderer() = default;
  /// Lets go of the thread, so that another can draw (or destroy) it.
  virtual void release() = 0;
  /// Whether the GPU was reset and has forgotten everything: what was drawn since then is worth
  /// nothing, and only a new renderer will draw again. Asks the driver; neither waits nor
  /// allocates.
  [[nodiscard]] virtual bool lost() = 0;

  /// From the next frame on, draws for another profile. Only uploads; all that takes long was done
  /// when the profile was prepared, with this renderer's options.
  /// Errors: kInvalidOption (another raster, other bits or another luminance ceiling: a restart is
  /// needed); the old one stays.
  [[nodiscard]] virtual Status set_profile(const PreparedProfile& profile) = 0;
  /// Issues the GL commands of one frame. No allocation, no read-back, no wait.
  virtual void draw(const FrameInput& input) = 0;
  /// Issues the commands that bring the last frame's codes into a buffer of the display: as they
  /// are, in the low bits of 8-bit channels, or widened to 10 where the format has more than the
  /// profile. Software drivers leave no fence in it: finish() comes before it is shown.
  virtual void draw_to_scanout(std::size_t buffer) = 0;
  /// Waits for the last frame and reads it: codes of ProjectorProfile::bits bits, first row on top.
  /// Of a GPU that was reset, all is 0.
  virtual void read_codes(ImageView<Rgb16> codes) = 0;
  /// The same for the target luminance before compensation, XYZ in cd/m^2 (0 outside the object).
  virtual void read_target(ImageView<Rgb32f> target_xyz) = 0;
  /// Waits until the GPU is done with the last frame (outputs that want no pixels still need this
  /// to time a frame).
  virtual void finish() = 0;
  [[nodiscard]] virtual FrameStatistics statistics() = 0;
  /// GL renderer and version, for logs and reports.
  [[nodiscard]] virtual std::string description() const = 0;
};

}  // namespace veneer::render
