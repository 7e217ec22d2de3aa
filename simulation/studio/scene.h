// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "capture/hands.h"
#include "capture/plan.h"
#include "simulation/studio/board_picture.h"
#include "simulation/studio/geometry.h"
#include "simulation/studio/jones.h"
#include "simulation/studio/traced_sample.h"
#include "simulation/studio/truth.h"

namespace veneer::simulation::studio {

/// How the rig stands.
struct Arrangement {
  capture::Target target = capture::Target::kSample;
  int view = 0;
  int light = 0;
  bool dark = false;  ///< the projector sends nothing
  double analyser_rad = 0;

  friend bool operator==(const Arrangement&, const Arrangement&) = default;
};

/// The light in the camera. A white diffuser without a polariser before the camera, lit along its
/// normal, is the truth's irradiance; so is one that the room's light falls on, times `ambient`.
///
/// Light that was in a body, or on paper, has lost its polarisation. The rest was mirrored once: by
/// a facet of the sample's dielectric interface, half-way between light and view, or by metal. A
/// picture's directions are those of its view and light, the same all over the sample.
class StudioScene {
 public:
  /// How much brighter the light's image in a mirror is than white: of metal, in a rig whose source
  /// is wide.
  static constexpr double kMirrorStrength = 20;
  /// What mirror and ball scatter, Lambertian.
  static constexpr double kScatter = 0.004;
  /// What the ball's metal reflects of the board.
  static constexpr double kBallReflectance = 0.9;
  /// Standard deviation of the light's image in the ball, as an angle between rays: a projector's
  /// lens of 30 mm in 1 m distance, about.
  static constexpr double kBallLobe_rad = 0.02;

  /// @param lights  where they really are; unit, above the horizon, across the axis somewhere.
  StudioScene(const StudioTruth& truth,
              const capture::CapturePlan& plan,
              StudioGeometry geometry,
              BoardPicture board,
              TracedSample sample,
              std::vector<Eigen::Vector3d> lights);

  [[nodiscard]] const StudioGeometry& geometry() const { return geometry_; }
  [[nodiscard]] const std::vector<Eigen::Vector3d>& lights() const { return lights_; }
  [[nodiscard]] const TracedSample& sample() const { return sample_; }

  /// Mean light of every pixel; a mosaic's pixel each behind its own analyser. Keeps what the next
  /// picture of the same view and light needs too.
  [[nodiscard]] Image<Rgb32f> light(const Arrangement& arrangement);

 private:
  /// What a pixel sees of the sample's plane, of one view.
  struct Seen {
    struct Part {
      std::uint32_t texel;
      float weight;  // of the pixel's rays
    };
    std::vector<std::vector<Part>> rows;  // the parts of a row's pixels, one after the other
    std::vector<std::uint32_t> first;     // of a pixel's parts in its row; [height][width + 1]
    std::vector<float> area;              // of the pixel that is sample area
    std::vector<float> board;             // mean reflectance of the rest, times its share
    std::vector<float> fall_off;          // of the projector's light
  };
  /// The light of one target, view and light before the analyser, for a projector of unit
  /// irradiance.
  struct Layers {
    capture::Target target{};
    int view = -1;
    int light = -1;
    Image<Rgb32f> mirrored;  // under unpolarised light, before Fresnel's shares
    Image<Rgb32f> lost;      // without polarisation
    Image<Rgb32f> room;      // of room light, in parts of white
  };

  void look(int view);
  void lay(const Arrangement& arrangement);
  void lay_sample(Layers& layers) const;
  void lay_plate(Layers& layers, double mirrored, double lost, double room) const;
  void lay_ball(Layers& layers) const;
  [[nodiscard]] Beam mirrored_beam(const Arrangement& arrangement) const;

  StudioTruth truth_;
  capture::CapturePlan plan_;
  StudioGeometry geometry_;
  BoardPicture board_;
  TracedSample sample_;
  std::vector<Eigen::Vector3d> lights_;
  std::vector<float> vignetting_;
  int seen_view_ = -1;
  Seen seen_;
  Layers layers_;
};

}  // namespace veneer::simulation::studio
