// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "calibration/profile.h"
#include "quality/reach.h"
#include "quality/screen_reference.h"
#include "quality/visible_difference.h"
#include "render/scene.h"

namespace veneer::quality {

struct PlanOptions {
  /// What a frame's draw pass may take on this machine; nothing: whatever it takes. > 0.
  std::optional<double> frame_ms{};
  /// Of the mean over what is asked: no further components are added below it. > 0.
  double max_de00 = 0.5;
  /// Which models are tried; empty: planned_models().
  std::vector<std::string> models{};
  /// Whether the fit for any scene is made too, to say what was saved. It is most of the time.
  bool compare_general = true;
  std::uint64_t seed = 1;
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

/// How far a fit is from the full BTF on the projector's raster.
struct OnScreen {
  ScreenErrors centre;    ///< each pixel shows the texel at its centre
  ScreenErrors averaged;  ///< each pixel shows the mean of the texels under it
};

/// A fit and how it does in the scene.
struct PlannedFit {
  std::string model;
  btf::FitOptions options;                        ///< `region` and `ranks` are not kept
  bool for_region = true;                         ///< else for any scene
  std::shared_ptr<const btf::Material> material;  ///< shared by the steps and what was chosen
  VisibleDifference difference;                   ///< from the full BTF, over what is asked
  double set_rmse = 0;                            ///< weighted_rmse() over the reach
  int fetches = 0;                                ///< of a pixel and light
  double bytes = 0;                               ///< on the GPU
  double fit_seconds = 0;
  std::optional<double> frame_ms;     ///< of the draw pass, where it was measured
  std::optional<OnScreen> on_screen;  ///< where it was measured: measure_plan_on_screen()

  /// "texel-colours 3+1, 32 clusters, 16 nodes"
  [[nodiscard]] std::string name() const;
};

/// One thing that was tried.
struct PlanStep {
  std::string what;
  VisibleDifference difference;  ///< what it leaves, or of a term what leaving it out would change
  int fetches = 0;               ///< 0 where it is no fit
  double bytes = 0;
  bool taken = false;
  std::string verdict;  ///< in words
};

struct Plan {
  Reach reach;
  PlannedFit chosen;
  bool is_invisible = false;         ///< the error of what was chosen
  std::vector<std::string> dropped;  ///< terms, in words, with what they would have changed
  std::vector<PlanStep> steps;
  /// The same model with as many components, fitted for any scene; and with as few as bring its
  /// drawn rmse down to that of what was chosen, or with the most there are.
  std::optional<PlannedFit> general;
  std::optional<PlannedFit> general_alike;
};

/// The models that suit the set and the scene: lobes where they suffice, texel-colours and
/// revised-lpca, dichromatic-lpca of polarised sets, eigen-texture where all light comes from one
/// place.
[[nodiscard]] std::vector<std::string> planned_models(const btf::SampleSetInfo& set,
                                                      const Reach& reach);

/// Measures a material in the scene: milliseconds of a draw pass.
using TimeMaterial = std::function<Result<double>(const btf::Material&)>;

/// Finds what the scene asks (find_reach) and fits only that.
///
/// For each model, components are added until the error is invisible on this projector (mean dE00
/// at most max_de00, or under one code value) and no further. Before that, the second term of a
/// model is dropped where leaving it out is never seen (VisibleDifference::is_never_seen). Grids
/// are as fine and clusters as many as a small region has room for in the bytes of a general fit,
/// since neither costs fetches; once the components suffice, both are taken away as long as the
/// error stays invisible. Of the models whose error is invisible the one of fewest fetches is
/// chosen, of equal ones that of fewest bytes; where there is none, that of least mean error. If a
/// frame may not take as long as that, the next best of all that was tried which may.
///
/// Deterministic but for timing. Errors: those of find_reach(), of the profile, of the fits;
/// kInvalidOption (no model can be fitted to this set).
/// @param time  asked only with PlanOptions::frame_ms.
[[nodiscard]] Result<Plan> make_plan(const btf::SampleSet& set,
                                     const render::Scene& scene,
                                     const calibration::ProjectorProfile& profile,
                                     const PlanOptions& options,
                                     const TimeMaterial& time,
                                     Progress& progress);

}  // namespace veneer::quality
