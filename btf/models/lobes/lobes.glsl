// max(0, c . u)^n of a stored lobe (c, n). The double-precision counterpart is lobe_value(); change
// both or none.
float lobe(vec4 stored, vec3 u) {
  float base = dot(stored.xyz, u);
  return base > 0.0 ? pow(base, stored.w) : 0.0;
}
