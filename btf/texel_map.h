// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/result.h"

namespace veneer::btf {

/// A tile of places, each of which shows a texel of a smaller sample. It repeats, so that its last
/// column lies beside its first, its last row above its first.
class TexelMap {
 public:
  /// Column and row of a texel of the sample.
  using Source = std::array<std::uint16_t, 2>;
  /// Places along a side at most: what every GL 4.5 takes as a texture.
  static constexpr int kMostSide = 16384;

  /// @param sources  of every place, row by row.
  /// Errors: kBadFormat (a side out of range, another number of sources, a source that is not in a
  /// sample of `sample_width` x `sample_height` texels).
  [[nodiscard]] static Result<TexelMap> create(
      int width, int height, std::vector<Source> sources, int sample_width, int sample_height);

  [[nodiscard]] int width() const { return width_; }    ///< places
  [[nodiscard]] int height() const { return height_; }  ///< places
  [[nodiscard]] int place_count() const { return width_ * height_; }
  [[nodiscard]] int sample_width() const { return sample_width_; }    ///< texels
  [[nodiscard]] int sample_height() const { return sample_height_; }  ///< texels
  [[nodiscard]] const std::vector<Source>& sources() const { return sources_; }
  /// The number of the texel that a place shows, texels of the sample counted row by row.
  [[nodiscard]] int source_texel(int place) const {
    const Source& source = sources_[static_cast<std::size_t>(place)];
    return source[1] * sample_width_ + source[0];
  }

 private:
  TexelMap() = default;

  int width_ = 0;
  int height_ = 0;
  int sample_width_ = 0;
  int sample_height_ = 0;
  std::vector<Source> sources_;
};

}  // namespace veneer::btf
