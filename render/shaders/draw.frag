// Draws what the material would send to the eye. With IN_COMPUTE draw.comp stands behind it.
#ifdef IN_COMPUTE
struct Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
};
Surface surface;
vec4 target;
#else
in Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

layout(location = 0) out vec4 target;
#endif

void shade() {
  vec3 normal = normalize(surface.normal);
  mat3 object_from_local = local_frame(normal, surface.tangent);
  vec3 view = view_at(surface.position) * object_from_local;

  vec3 rgb = vec3(0.0);
  for (int i = 0; i < LIGHT_COUNT; ++i) {
    vec4 light = light_at(i, surface.position);
    rgb += RADIANCE(surface.uv, view, light.xyz * object_from_local) *
           (frame.light_rgb[i].rgb * light.w);
  }
  target = target_of(rgb, projector_geometry(normal, surface.position));
}

#ifndef IN_COMPUTE
void main() {
  uv_width = fwidth(surface.uv);
  shade();
}
#endif
