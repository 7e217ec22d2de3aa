uniform sampler2DArray Factors;
uniform usampler2D ViewCells;
uniform sampler2D ViewRegions;

vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {
  ivec2 texel = texel_at(uv);
  view.z = max(view.z, 0.0);
  DirectionWeights v = direction_weights(ViewCells, ViewRegions, view);
  vec3 factor = vec3(0.0);
  for (int i = 0; i < 3; ++i)
    factor += v.weight[i] * texelFetch(Factors, ivec3(texel, v.index[i]), 0).rgb;
  return light.z > 0.0 ? factor * lafortune(texel, view, light) : vec3(0.0);
}
