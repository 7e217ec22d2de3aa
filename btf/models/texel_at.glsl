// The texel of a place in repeats of the sample. Before it stands the constant kTexels.
ivec2 texel_at(vec2 uv) {
  return min(ivec2(fract(uv) * vec2(kTexels)), kTexels - 1);
}
