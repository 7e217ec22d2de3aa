// Which of two levels a place of the raster shows while one takes the other's place: FadePart.
uniform float fade;
uniform bool part_is_next;

// @param place  in pixels of the projector.
bool is_in_part(vec2 place) {
  uvec2 tile = uvec2(place) / kFadeTile;
  uint order = tile.x * 0xC13FA9A9u + tile.y * 0x91E10DA5u;
  return ((float(order >> 8) + 0.5) / 16777216.0 < fade) == part_is_next;
}
