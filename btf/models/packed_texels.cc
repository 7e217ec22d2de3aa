// SPDX-License-Identifier: Apache-2.0
#include "btf/models/packed_texels.h"

namespace veneer::btf {
namespace {

// Lanes 0, 1 are the low and high half of the first uint, and so on.
std::string uint_of(int index) {
  return fmt::format("word{}.{}",
                     index / PackedTexels::kLanesPerWord,
                     "xyzw"[index % PackedTexels::kLanesPerWord / 2]);
}

}  // namespace

Status PackedTexels::check(const TexelPyramid& pyramid, Errc code, std::string_view doing) const {
  return check_texture("the texels",
                       static_cast<std::int64_t>(pyramid.texture_width()) * words_,
                       pyramid.texture_height(),
                       code,
                       doing);
}

ModelTexture PackedTexels::texture(const TexelPyramid& pyramid, const Fill& fill) const {
  ModelTexture texture{.sampler = "PackedTexels",
                       .kind = TextureKind::k2D,
                       .format = TexelFormat::kRgba32ui,
                       .width = pyramid.texture_width() * words_,
                       .height = pyramid.texture_height()};
  const auto per_texel = static_cast<std::size_t>(words_) * kLanesPerWord;
  std::vector<std::uint16_t> lanes(static_cast<std::size_t>(pyramid.texture_width()) *
                                   static_cast<std::size_t>(pyramid.texture_height()) * per_texel);
  for (int texel = 0; texel < pyramid.texel_count(); ++texel) {
    const auto [x, y] = pyramid.place(texel);
    const auto at =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(pyramid.texture_width()) +
        static_cast<std::size_t>(x);
    fill(texel, std::span(lanes).subspan(at * per_texel, per_texel));
  }
  texture.data = texture_data(lanes);
  return texture;
}

std::string PackedTexels::fetch() const {
  std::string source;
  for (int word = 0; word < words_; ++word)
    source += fmt::format(
        "  uvec4 word{0} = texelFetch(PackedTexels, ivec2(texel.x * {1} + {0}, texel.y), 0);\n",
        word,
        words_);
  return source;
}

std::string PackedTexels::half_lane(int index) {
  return fmt::format("unpackHalf2x16({}).{}", uint_of(index), "xy"[index % 2]);
}

std::string PackedTexels::uint_lane(int index) {
  return fmt::format("(({} >> {}) & 0xffffu)", uint_of(index), index % 2 * 16);
}

}  // namespace veneer::btf
