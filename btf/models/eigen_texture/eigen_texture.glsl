// Eigen-textures of the three nearest views (eigen_texture.h). Before this stand the constants of one
// material, behind it eigen_texture_of().
uniform sampler2D EigenWeights;
uniform sampler2DArray EigenTextures;
uniform usampler2D ViewCells;
uniform sampler2D ViewRegions;
uniform usampler2D LightCells;
uniform sampler2D LightRegions;

// What depends on the directions alone: the views and, for each, the components' weights mixed over
// the lights, the view's own weight in them.
struct EigenMix {
  ivec3 views;
  vec4 weights[3 * kWeightWords];
};

EigenMix eigen_mix(vec3 view, vec3 light) {
  view.z = max(view.z, 0.0);
  DirectionWeights v = direction_weights(ViewCells, ViewRegions, view);
  DirectionWeights l = direction_weights(LightCells, LightRegions, light);
  l.weight *= light.z > 0.0 ? l.scale : 0.0;
  EigenMix mixed;
  mixed.views = v.index;
  for (int i = 0; i < 3; ++i)
    for (int word = 0; word < kWeightWords; ++word) {
      int row = v.index[i] * kWeightWords + word;
      mixed.weights[kWeightWords * i + word] =
          v.weight[i] * (l.weight.x * texelFetch(EigenWeights, ivec2(l.index.x, row), 0) +
                         l.weight.y * texelFetch(EigenWeights, ivec2(l.index.y, row), 0) +
                         l.weight.z * texelFetch(EigenWeights, ivec2(l.index.z, row), 0));
    }
  return mixed;
}
