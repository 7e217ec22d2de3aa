// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "btf/models/material_tensors.h"
#include "btf/texel_pyramid.h"

namespace veneer::btf {

/// What one texel needs for its whole evaluation, in 16-bit lanes of as few RGBA32UI texels as hold
/// them ("words"), which stand side by side: one fetch each.
class PackedTexels {
 public:
  static constexpr int kLanesPerWord = 8;
  /// @param lanes  of a texel.
  explicit PackedTexels(int lanes) : words_((lanes + kLanesPerWord - 1) / kLanesPerWord) {}
  [[nodiscard]] int words() const { return words_; }
  /// Refuses, with `code`, sizes that GPUs might not take.
  [[nodiscard]] Status check(const TexelPyramid& pyramid, Errc code, std::string_view doing) const;
  [[nodiscard]] Status check(const MaterialFrame& frame, Errc code, std::string_view doing) const {
    return check(TexelPyramid(frame.width, frame.height, 1), code, doing);
  }
  /// The texture "PackedTexels". @param fill  writes the lanes of one texel, which are 0 before.
  using Fill = std::function<void(int texel, std::span<std::uint16_t> lanes)>;
  [[nodiscard]] ModelTexture texture(const TexelPyramid& pyramid, const Fill& fill) const;
  [[nodiscard]] ModelTexture texture(const MaterialFrame& frame, const Fill& fill) const {
    return texture(TexelPyramid(frame.width, frame.height, 1), fill);
  }
  /// GLSL: declares and fetches word0, word1, ... of the place `ivec2 texel`.
  [[nodiscard]] std::string fetch() const;
  /// GLSL: a lane that holds float16.
  [[nodiscard]] static std::string half_lane(int index);
  /// GLSL: a lane that holds an integer, as uint.
  [[nodiscard]] static std::string uint_lane(int index);

 private:
  int words_;
};

}  // namespace veneer::btf
