// SPDX-License-Identifier: Apache-2.0
#include "btf/texel_pyramid.h"

#include <algorithm>
#include <bit>
#include <vector>

namespace veneer::btf {
namespace {

constexpr char kTexelAtGlsl[] =
#include "btf/models/texel_at.glsl.inc"
    ;
constexpr char kTexelOfLevelGlsl[] =
#include "btf/models/texel_of_level.glsl.inc"
    ;

// How much of the sample's texel `i` lies in the share of texel `at` out of `count`, along a side
// of `size` texels, in units of 1 / count texels.
int overlap(int i, int at, int count, int size) {
  return std::min((i + 1) * count, (at + 1) * size) - std::max(i * count, at * size);
}

}  // namespace

TexelPyramid::TexelPyramid(int width, int height, int levels)
    : width_(width), height_(height), levels_(levels) {
  VENEER_CHECK(levels >= 1 && levels <= most_levels(width, height));
}

int TexelPyramid::most_levels(int width, int height) {
  return std::bit_width(static_cast<unsigned>(std::min(width, height)));
}

int TexelPyramid::first(int level) const {
  int count = 0;
  for (int l = 0; l < level; ++l) count += width(l) * height(l);
  return count;
}

int TexelPyramid::level_of(int texel) const {
  int level = 0;
  while (texel >= first(level + 1)) ++level;
  return level;
}

std::pair<int, int> TexelPyramid::place(int texel) const {
  const int level = level_of(texel);
  const int in_level = texel - first(level);
  const int x = in_level % width(level);
  const int y = in_level / width(level);
  if (level == 0) return {x, y};
  // Behind all levels above: w - (w >> (l - 1)) >= (w >> 1) + ... + (w >> (l - 1)).
  return {width_ - (width_ >> (level - 1)) + x, height_ + y};
}

std::string TexelPyramid::glsl() const {
  return fmt::format("const ivec2 kTexels = ivec2({}, {});\n", width_, height_) +
         (levels_ > 1 ? kTexelOfLevelGlsl : kTexelAtGlsl);
}

namespace {

// @param read  read(texel of the sample, out).
template <class Read>
void average(const TexelPyramid& pyramid, int texel, std::span<float> out, const Read& read) {
  const int level = pyramid.level_of(texel);
  if (level == 0) return read(texel, out);
  const int columns = pyramid.width(level);
  const int rows = pyramid.height(level);
  const int x = (texel - pyramid.first(level)) % columns;
  const int y = (texel - pyramid.first(level)) / columns;
  const int width = pyramid.width(0);
  const int height = pyramid.height(0);
  const float whole = static_cast<float>(width) * static_cast<float>(height);
  std::vector<float> rgb(out.size());
  std::ranges::fill(out, 0.0F);
  for (int j = y * height / rows; j * rows < (y + 1) * height; ++j)
    for (int i = x * width / columns; i * columns < (x + 1) * width; ++i) {
      const float share =
          static_cast<float>(overlap(i, x, columns, width) * overlap(j, y, rows, height)) / whole;
      read(j * width + i, std::span(rgb));
      for (std::size_t k = 0; k < out.size(); ++k) out[k] += share * rgb[k];
    }
}

}  // namespace

void pyramid_rgb(
    const SampleSet& set, const TexelPyramid& pyramid, int texel, Part part, std::span<float> out) {
  average(pyramid, texel, out, [&](int of, std::span<float> values) { set.rgb(of, part, values); });
}

void pyramid_rgb(const SampleSet& set,
                 const TexelPyramid& pyramid,
                 int texel,
                 Part part,
                 std::span<const int> pairs,
                 std::span<float> out) {
  average(pyramid, texel, out, [&](int of, std::span<float> values) {
    set.rgb(of, part, pairs, values);
  });
}

}  // namespace veneer::btf
