vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {
  vec2 scalars;
  vec3 colours[1];
  packed_evaluate(uv, view, light, scalars, colours);
  vec3 specular = SPECULAR_WEIGHT * scalars.y * kSpecularColour;
  vec3 sum = kSubtractive
                 ? min(1.0, light.z / kBorderCosine) *
                       (colours[0] - scalars.x * kShadeColour + specular)
                 : scalars.x * colours[0] + specular;
  return light.z > 0.0 ? max(sum, 0.0) : vec3(0.0);
}

#ifdef CACHE_PIXELS
// Of the form "ratio": the other adds a constant that fades with the light.
vec3 btf_radiance_cached(vec2 uv) {
  vec2 scalars;
  vec3 colours[1];
  packed_cached(uv, scalars, colours);
  return max(scalars.x * colours[0] + SPECULAR_WEIGHT * scalars.y * kSpecularColour, 0.0);
}
#endif
