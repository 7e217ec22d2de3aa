vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {
  view.z = max(view.z, 0.0);
  return light.z > 0.0 ? lafortune(texel_at(uv), view, light) : vec3(0.0);
}
