// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <Eigen/Core>

#include <string>

#include "base/result.h"
#include "render/gl_objects.h"

namespace veneer::render {

/// The part of the picture that one of two levels has while the other takes its place. The picture
/// goes over in tiles, each exactly once as fade grows. Neighbours go over far apart in time: the
/// order is a lattice that is even over any run of it (Roberts 2018), as dither's is.
struct FadePart {
  float fade = 0;        ///< how much is the next level's, between 0 and 1
  bool is_next = false;  ///< whether this part is the next level's
};
/// Pixels of the projector's raster along a tile's side: large beside what early depth tests reject
/// at once, small beside the object.
inline constexpr int kFadeTile = 16;

/// What shaders need to know a part: kFadeTile and fade.glsl.
[[nodiscard]] std::string fade_source();
[[nodiscard]] std::string fade_mask_fragment_source();

/// Writes depth so that a draw shades one part alone: what is 'nearest' there rejects fragments
/// before they cost anything. Needs a current context, always the same.
class FadeMask {
 public:
  /// The raster that is drawn on, and how far beyond the part it is needed.
  struct Raster {
    Eigen::Vector2i size{0, 0};
    Eigen::Vector2f pixels{1, 1};  ///< of the projector, along each side of one of this raster
    Eigen::Vector2f reach{0, 0};   ///< in pixels of the projector; at most half a tile
  };
  /// Errors: kUnavailable (the driver refuses the shader).
  [[nodiscard]] static Result<FadeMask> create();
  /// Fills the depth of the framebuffer that is bound: farthest on the part, nearest elsewhere.
  /// Leaves depth tests as draw passes want them; changes the program and the vertex array.
  void write(const FadePart& part, const Raster& raster) const;

 private:
  FadeMask() = default;
  GlProgram program_;
  GlVertexArray no_vertices_;
  GLint fade_ = -1;
  GLint is_next_ = -1;
  GLint pixels_ = -1;
  GLint reach_ = -1;
  GLint corners_ = -1;
};

/// What keeps a draw to its part.
struct DrawMask {
  const FadeMask& mask;
  FadePart part;
  FadeMask::Raster raster;
  void write() const { mask.write(part, raster); }
};

}  // namespace veneer::render
