// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"
#include "btf/interpolated_set.h"
#include "calibration/profile.h"
#include "quality/trade/run.h"
#include "render/scene.h"

namespace veneer::quality {

struct SceneToolsOptions {
  int views = 4;      ///< places of the observer. 1 to 64.
  int frames = 20;    ///< timed draws of each candidate. 3 to 10000.
  int pixels = 2000;  ///< compared from each place
  int crop_width = 160;
  int crop_height = 120;
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

/// The tools of a real run: fits to a set, draws a scene through a profile, and looks at it with
/// the full BTF. Makes an EGL context where one is needed.
class SceneTools {
 public:
  /// @param set  borrowed, must outlive the tools. Errors: those of ScreenReference::make.
  [[nodiscard]] static Result<SceneTools> make(render::Scene scene,
                                               calibration::ProjectorProfile profile,
                                               const btf::InterpolatedSet& set,
                                               const SceneToolsOptions& options,
                                               Progress& progress);
  SceneTools(SceneTools&&) noexcept;
  ~SceneTools();

  /// Borrows from this object.
  [[nodiscard]] TradeTools tools() const;

  /// What the full BTF asks for in the crop, XYZ in cd/m^2; NaN where nothing is compared.
  [[nodiscard]] const Image<Rgb32f>& reference_crop() const;
  [[nodiscard]] const ScreenReference& reference() const;

 private:
  struct State;
  explicit SceneTools(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// What tells one run from another: names of the inputs with fingerprints of what is in them.
/// @param mesh_name  of the scene; counts where it is a file. Errors: kNotFound, kIo.
[[nodiscard]] Result<std::vector<std::pair<std::string, std::string>>> identity_of(
    const std::filesystem::path& set,
    const std::filesystem::path& scene,
    const std::string& mesh_name,
    const std::filesystem::path& profile,
    const GridOptions& grid,
    const SceneToolsOptions& options);

}  // namespace veneer::quality
