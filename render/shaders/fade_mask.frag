// Depth that lets a draw through on its part of the picture alone, and where that reaches to.
uniform vec2 pixels;  // of the projector in one of this raster
uniform vec2 reach;   // in the projector's
uniform int corners;  // 4; without a reach 1 says all

void main() {
  vec2 place = gl_FragCoord.xy * pixels;
  // A reach within half a tile touches no more tiles than its corners. The count is no constant, so
  // that software rasterisers, which skip no branch, do one turn where one is enough.
  bool wanted = false;
  for (int i = 0; i < corners; ++i) {
    vec2 side = vec2(ivec2(i & 1, i >> 1) * 2 - 1);
    wanted = wanted || is_in_part(max(place + side * reach, vec2(0.0)));
  }
  gl_FragDepth = wanted ? 0.0 : 1.0;
}
