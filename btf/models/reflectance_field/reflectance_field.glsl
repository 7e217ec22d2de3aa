// The diffuse colour in the first layer, then for each view its specular colour and its lobes.
uniform sampler2DArray Fields;
uniform usampler2D ViewCells;
uniform sampler2D ViewRegions;

vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {
  ivec2 texel = texel_at(uv);
  view.z = max(view.z, 0.0);
  DirectionWeights v = direction_weights(ViewCells, ViewRegions, view);
  vec3 specular = vec3(0.0);
  for (int i = 0; i < 3; ++i) {
    int layer = 1 + v.index[i] * (1 + kLobes);
    float lobes = 0.0;
    for (int j = 1; j <= kLobes; ++j)
      lobes += lobe(texelFetch(Fields, ivec3(texel, layer + j), 0), light);
    specular += v.weight[i] * lobes * texelFetch(Fields, ivec3(texel, layer), 0).rgb;
  }
  vec3 sum = texelFetch(Fields, ivec3(texel, 0), 0).rgb + SPECULAR_WEIGHT * specular;
  return light.z > 0.0 ? light.z * sum : vec3(0.0);
}
