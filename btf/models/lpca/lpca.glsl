uniform usampler2D Clusters;
uniform sampler2DArray Weights;
uniform sampler2DArray EigenBrdfs;
uniform usampler2D ViewCells;
uniform sampler2D ViewRegions;
uniform usampler2D LightCells;
uniform sampler2D LightRegions;

vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {
  ivec2 texel = texel_at(uv);
  int cluster = int(texelFetch(Clusters, texel, 0).r);
  view.z = max(view.z, 0.0);
  DirectionWeights v = direction_weights(ViewCells, ViewRegions, view);
  DirectionWeights l = direction_weights(LightCells, LightRegions, light);
  vec3 sum = vec3(0.0);
  for (int layer = 0; 4 * layer < kComponents; ++layer) {
    vec4 weight = texelFetch(Weights, ivec3(texel, layer), 0);
    for (int c = 4 * layer; c < min(4 * layer + 4, kComponents); ++c) {
      vec3 brdf = vec3(0.0);
      for (int i = 0; i < 3; ++i) {
        int row = c * kViews + v.index[i];
        brdf += v.weight[i] *
                (l.weight.x * texelFetch(EigenBrdfs, ivec3(l.index.x, row, cluster), 0).rgb +
                 l.weight.y * texelFetch(EigenBrdfs, ivec3(l.index.y, row, cluster), 0).rgb +
                 l.weight.z * texelFetch(EigenBrdfs, ivec3(l.index.z, row, cluster), 0).rgb);
      }
      sum += weight[c - 4 * layer] * brdf;
    }
  }
  return light.z > 0.0 ? max(l.scale * sum, 0.0) : vec3(0.0);
}
