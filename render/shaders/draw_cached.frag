// draw.frag with the directions' part read from the cache (angular_cache.h).
in Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

layout(location = 0) out vec4 target;

void main() {
  uv_width = fwidth(surface.uv);
  cache_place = (gl_FragCoord.xy / kSpacing + kMargin + 0.5) / vec2(textureSize(CacheValues, 0).xy);
  vec3 rgb = vec3(0.0);
  for (int i = 0; i < LIGHT_COUNT; ++i) {
    cache_layer = i * kCacheLightLayers;
    rgb += RADIANCE(surface.uv, vec3(0.0), vec3(0.0)) *
           (frame.light_rgb[i].rgb * light_at(i, surface.position).w);
  }
  target = target_of(rgb, projector_geometry(normalize(surface.normal), surface.position));
}
