// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <memory>

#include "base/clock.h"
#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "capture/camera.h"
#include "capture/hands.h"
#include "capture/plan.h"
#include "capture/polariser.h"
#include "simulation/studio/truth.h"

namespace veneer::simulation {

/// A virtual capture studio: sample, marks, projector and camera with their polarisers. Fields of
/// light are followed as Jones vectors, incoherent parts added; it shares no code with
/// capture/polarisation, which it judges. The same for the same seeds. To be called from one
/// thread.
class VirtualStudio {
 public:
  /// Path-traces the sample for the plan's directions (kept in `cache`, if that is not empty). At
  /// first the sample lies there, view and light are number 0, the projector is lit, the analyser
  /// is parallel. Errors: kInvalidOption, kIo.
  [[nodiscard]] static Result<std::unique_ptr<VirtualStudio>> create(
      const StudioTruth& truth,
      const capture::CapturePlan& plan,
      const std::filesystem::path& cache,
      Progress& progress);
  ~VirtualStudio();

  [[nodiscard]] capture::Camera& camera();
  [[nodiscard]] capture::Polariser* polariser();  ///< null with a mosaic
  [[nodiscard]] capture::Hands& hands();
  [[nodiscard]] Clock& clock();  ///< virtual; exposures and hands take their time

  /// What a perfect capture would give at the plan's texels: unit of a sample set.
  struct TexelTruth {
    Image<Rgb32f> specular;  ///< all specular light under the rig's polarised light: a perfect
                             ///< polariser along its axis
    Image<Rgb32f> diffuse;
    Image<Rgb32f> unpolarised_specular;
  };
  /// @param view, light  of the plan.
  [[nodiscard]] TexelTruth truth(int view, int light) const;
  /// Where a light really is; local frame, unit.
  [[nodiscard]] Eigen::Vector3d light_direction(int light) const;
  [[nodiscard]] capture::CameraLens lens() const;
  /// Metres; the board's z into the board, away from the camera.
  [[nodiscard]] RigidTransform camera_from_board(int view) const;
  /// Mean light that every pixel gets now, without the sensor's doing. Light of 1 (a white diffuser
  /// lit along its normal, no polariser before the camera, no vignetting) fills the well in 0.1 s.
  [[nodiscard]] Image<Rgb32f> light();

 private:
  struct State;
  explicit VirtualStudio(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::simulation
