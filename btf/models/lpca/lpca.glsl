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
  vec4 weight = vec4(0.0);
  // One loop, not one in another: compilers write its few turns out, which takes a third less time.
  for (int c = 0; c < kComponents; ++c) {
    if (c % 4 == 0) weight = texelFetch(Weights, ivec3(texel, c / 4), 0);
    vec3 brdf = vec3(0.0);
    for (int i = 0; i < 3; ++i) {
      int row = c * kViews + v.index[i];
      brdf += v.weight[i] *
              (l.weight.x * texelFetch(EigenBrdfs, ivec3(l.index.x, row, cluster), 0).rgb +
               l.weight.y * texelFetch(EigenBrdfs, ivec3(l.index.y, row, cluster), 0).rgb +
               l.weight.z * texelFetch(EigenBrdfs, ivec3(l.index.z, row, cluster), 0).rgb);
    }
    sum += weight[c % 4] * brdf;
  }
  return light.z > 0.0 ? max(l.scale * sum, 0.0) : vec3(0.0);
}

#ifdef CACHE_NODES
struct EigenPlace {
  DirectionWeights view;
  DirectionWeights light;
};

EigenPlace eigen_place(vec3 view, vec3 light) {
  view.z = max(view.z, 0.0);
  EigenPlace place = EigenPlace(direction_weights(ViewCells, ViewRegions, view),
                                direction_weights(LightCells, LightRegions, light));
  place.light.weight *= light.z > 0.0 ? place.light.scale : 0.0;
  return place;
}

vec3 brdf_at(EigenPlace place, int cluster, int component) {
  vec3 brdf = vec3(0.0);
  for (int i = 0; i < 3; ++i) {
    int row = component * kViews + place.view.index[i];
    for (int j = 0; j < 3; ++j)
      brdf += place.view.weight[i] * place.light.weight[j] *
              texelFetch(EigenBrdfs, ivec3(place.light.index[j], row, cluster), 0).rgb;
  }
  return brdf;
}
#endif
