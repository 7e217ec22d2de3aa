// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"
#include "btf/direction.h"
#include "simulation/studio/truth.h"

namespace veneer::simulation::studio {

/// A tile of the sample, path-traced under unpolarised light for the studio's directions.
class TracedSample {
 public:
  /// @param size  texels along each side of the tile
  /// @param cache  folder in which traced tiles are kept and looked up; empty: none. A damaged one,
  ///               or one of other directions, is traced again; empty it when the materials or the
  ///               tracer change.
  /// Errors: kInvalidOption, kIo.
  [[nodiscard]] static Result<TracedSample> trace(const StudioTruth& truth,
                                                  int size,
                                                  const btf::DirectionSet& views,
                                                  const btf::DirectionSet& lights,
                                                  const std::filesystem::path& cache,
                                                  Progress& progress);

  /// Light of a texel; unit of a sample set (docs/CONVENTIONS.md).
  struct Texel {
    Rgb32f specular;
    Rgb32f diffuse;
  };
  [[nodiscard]] Texel texel(int view, int light, int column, int row) const;
  /// What it sends of light from all around, in parts of what a white diffuser would: the mean over
  /// the lights.
  [[nodiscard]] Rgb32f in_room_light(int view, int column, int row) const;

 private:
  TracedSample() = default;
  [[nodiscard]] std::size_t place(int view, int light, int column, int row) const;
  int size_ = 0;
  int lights_ = 0;
  float sum_of_cosines_ = 0;   // of the lights
  std::vector<Texel> texels_;  // [view][light][row][column]
};

}  // namespace veneer::simulation::studio
