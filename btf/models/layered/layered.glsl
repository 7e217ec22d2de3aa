uniform sampler2DArray Layers;

// LayerStack in float; change both or none. Before it stand the constants kTexels, kLayers, kHeights
// and kLeastCosine, and texel_at.glsl. Of layer n: 4n: K_d, transmittance; K_s, k; C, L_d; N.

// By how many places along columns and rows a ray moves while it rises by one.
vec2 layer_slope(vec3 direction) {
  // Rows grow towards -y.
  return vec2(direction.x, -direction.y) / max(direction.z, kLeastCosine);
}

// A place of the tile, which repeats. Half a place up, since GPUs divide to within rounding only.
ivec2 layer_place(vec2 at) {
  vec2 place = floor(at);
  place -= vec2(kPlaces) * floor((place + 0.5) / vec2(kPlaces));
  return clamp(ivec2(place), ivec2(0), kPlaces - 1);
}

// Loops have constant bounds, and conditions inside, so that compilers unroll them.
float layer_arriving(int layer, ivec2 place, vec2 slope) {
  float share = 1.0;
  for (int above = 0; above < kLayers; ++above) {
    if (above < layer && share > 0.0) {
      vec2 shift = (kHeights[above] - kHeights[layer]) * slope;
      ivec2 texel = source_texel(layer_place(vec2(place) + 0.5 + shift));
      share *= texelFetch(Layers, ivec3(texel, 4 * above), 0).a;
    }
  }
  return share;
}

// `texel` is what the tile shows at `place`, `first` what the layer's first texture holds there; what
// tells that the rest is dark comes first.
vec3 layer_radiance(int layer, ivec2 place, ivec2 texel, vec4 first, vec3 view, vec3 light) {
  float cosine = dot(texelFetch(Layers, ivec3(texel, 4 * layer + 3), 0).xyz, light);
  if (!(cosine > 0.0)) return vec3(0.0);
  vec4 shape = texelFetch(Layers, ivec3(texel, 4 * layer + 2), 0);
  float arrived = layer_arriving(layer, place, layer_slope(light)) + shape.w;
  if (!(arrived > 0.0)) return vec3(0.0);
  vec4 specular = texelFetch(Layers, ivec3(texel, 4 * layer + 1), 0);
  float peak = lobe(vec4(shape.xyz, specular.w), view * light);
  return arrived * cosine * (first.rgb + peak * specular.rgb);
}

vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {
  if (!(light.z > 0.0)) return vec3(0.0);
  view.z = max(view.z, 0.0);
  vec2 at = fract(uv) * vec2(kPlaces);
  vec2 slope = layer_slope(view);
  vec3 seen = vec3(0.0);
  float visible = 1.0;
  for (int layer = 0; layer < kLayers; ++layer) {
    if (visible > 0.0) {
      ivec2 place = layer_place(at + kHeights[layer] * slope);
      ivec2 texel = source_texel(place);
      vec4 first = texelFetch(Layers, ivec3(texel, 4 * layer), 0);
      seen += visible * layer_radiance(layer, place, texel, first, view, light);
      visible *= first.a;
    }
  }
  return seen;
}

// For shells (btf/model_shader.h).
vec4 btf_shell(int layer, vec2 uv, vec3 view, vec3 light) {
  ivec2 place = layer_place(fract(uv) * vec2(kPlaces));
  ivec2 texel = source_texel(place);
  vec4 first = texelFetch(Layers, ivec3(texel, 4 * layer), 0);
  view.z = max(view.z, 0.0);
  vec3 seen =
      light.z > 0.0 ? layer_radiance(layer, place, texel, first, view, light) : vec3(0.0);
  return vec4(seen, 1.0 - first.a);
}
