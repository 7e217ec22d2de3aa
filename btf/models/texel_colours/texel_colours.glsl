vec3 mix_colours(vec2 scalars, vec3 colours[2]) {
  return max(scalars.x * colours[0] + scalars.y * colours[1], 0.0);
}

vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {
  vec2 scalars;
  vec3 colours[2];
  packed_evaluate(uv, view, light, scalars, colours);
  return light.z > 0.0 ? mix_colours(scalars, colours) : vec3(0.0);
}

#ifdef CACHE_PIXELS
vec3 btf_radiance_cached(vec2 uv) {
  vec2 scalars;
  vec3 colours[2];
  packed_cached(uv, scalars, colours);
  return mix_colours(scalars, colours);
}
#endif
