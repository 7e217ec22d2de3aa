// What a model's btf_radiance_cached() reads. Before this stand kCacheLayers (of a cluster) and
// kCacheLightLayers (of all clusters).
uniform sampler2DArray CacheValues;

vec2 cache_place;  // of this pixel between the nodes
int cache_layer;   // the first of the light in hand

vec4 cached_eigen(int cluster, int layer) {
  return textureLod(CacheValues,
                    vec3(cache_place, float(cache_layer + cluster * kCacheLayers + layer)), 0.0);
}
