// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <utility>

#include "btf/sample_set.h"

namespace veneer::btf {

/// The texels of a sample and of its mip levels: level l has width >> l times height >> l texels,
/// each of which stands for its equal share of the sample. Level 0 is the sample itself. All are
/// numbered row by row, a level behind the one before it.
///
/// In a texture the sample stands above, and below it the other levels side by side.
class TexelPyramid {
 public:
  /// @param levels  1 to most_levels(width, height).
  TexelPyramid(int width, int height, int levels);
  /// So many that each side of the last has a texel.
  [[nodiscard]] static int most_levels(int width, int height);

  [[nodiscard]] int levels() const { return levels_; }
  [[nodiscard]] int width(int level) const { return width_ >> level; }
  [[nodiscard]] int height(int level) const { return height_ >> level; }
  /// The number of a level's first texel; of level levels(), how many texels there are.
  [[nodiscard]] int first(int level) const;
  [[nodiscard]] int texel_count() const { return first(levels_); }
  [[nodiscard]] int level_of(int texel) const;

  [[nodiscard]] int texture_width() const { return width_; }
  [[nodiscard]] int texture_height() const { return levels_ > 1 ? height_ + height_ / 2 : height_; }
  /// Column and row of a texel in the texture.
  [[nodiscard]] std::pair<int, int> place(int texel) const;
  /// GLSL: `ivec2 texel_at(vec2 uv)`, the place of what lies at a point in repeats of the sample.
  /// With more levels than one it takes that of `int texel_level`, which it declares as 0.
  [[nodiscard]] std::string glsl() const;

 private:
  int width_;
  int height_;
  int levels_;
};

/// RGB of a texel of the pyramid at every measured pair, as SampleSet::rgb(): of a mip level the
/// mean over the share that it stands for. Texels of the sample that lie across the border of two
/// shares count in each by area.
void pyramid_rgb(
    const SampleSet& set, const TexelPyramid& pyramid, int texel, Part part, std::span<float> out);
/// The same of some pairs.
void pyramid_rgb(const SampleSet& set,
                 const TexelPyramid& pyramid,
                 int texel,
                 Part part,
                 std::span<const int> pairs,
                 std::span<float> out);

}  // namespace veneer::btf
