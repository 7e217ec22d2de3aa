// texel_at.glsl for a sample with mip levels (texel_pyramid.h): the renderer says which is read.
int texel_level = 0;

ivec2 texel_at(vec2 uv) {
  ivec2 size = kTexels >> texel_level;
  ivec2 texel = min(ivec2(fract(uv) * vec2(size)), size - 1);
  int behind = kTexels.x - (2 * kTexels.x >> texel_level);
  return texel + (texel_level > 0 ? ivec2(behind, kTexels.y) : ivec2(0));
}
