// Depth that lets a draw through on its part of the picture alone, and where that reaches to.
uniform vec2 pixels;  // of the projector in one of this raster
uniform vec2 reach;   // in the projector's

void main() {
  vec2 place = gl_FragCoord.xy * pixels;
  vec2 before = max(place - reach, vec2(0.0));
  vec2 behind = place + reach;
  // A reach within half a tile touches no more tiles than its corners.
  bool wanted = is_in_part(before) || is_in_part(behind) ||
                is_in_part(vec2(before.x, behind.y)) || is_in_part(vec2(behind.x, before.y));
  gl_FragDepth = wanted ? 0.0 : 1.0;
}
