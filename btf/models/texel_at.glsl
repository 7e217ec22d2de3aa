// The texel of a place in repeats of the sample. Before it stands the constant kTexels, the size of
// the sample; where TEXEL_MAP is defined (mapped_material.h), kPlaces, the size of the map over it, too.
#ifdef TEXEL_MAP
ivec2 source_texel(ivec2 place) {
  return ivec2(texelFetch(TexelMap, place, 0).xy);
}
#else
const ivec2 kPlaces = kTexels;
ivec2 source_texel(ivec2 place) {
  return place;
}
#endif

ivec2 texel_at(vec2 uv) {
  return source_texel(min(ivec2(fract(uv) * vec2(kPlaces)), kPlaces - 1));
}
