// A direction of any length other than 0 in 32 bits: octahedral, 16 bits each way.
vec2 away_from_zero(vec2 v) { return vec2(v.x < 0.0 ? -1.0 : 1.0, v.y < 0.0 ? -1.0 : 1.0); }

uint word_of_direction(vec3 d) {
  d /= abs(d.x) + abs(d.y) + abs(d.z);
  return packSnorm2x16(d.z < 0.0 ? (1.0 - abs(d.yx)) * away_from_zero(d.xy) : d.xy);
}

vec3 direction_of_word(uint word) {
  vec2 v = unpackSnorm2x16(word);
  vec3 d = vec3(v, 1.0 - abs(v.x) - abs(v.y));
  if (d.z < 0.0) d.xy = (1.0 - abs(d.yx)) * away_from_zero(d.xy);
  return normalize(d);
}
