// What each pixel asks of the material, for reading back: screen_probe.h.
in Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

layout(location = 0) out vec4 place;  // uv; z: 1 where something is drawn; w: the geometric factor
layout(location = 1) out vec4 steps;  // of uv to the next pixel on the right, and to the one below
layout(location = 2) out vec4 eye;    // the local direction to it
layout(location = 3) out vec4 lights[LIGHT_COUNT];  // local directions; w: as light_at()

void main() {
  vec3 normal = normalize(surface.normal);
  mat3 object_from_local = local_frame(normal, surface.tangent);
  place = vec4(surface.uv, 1.0, projector_geometry(normal, surface.position));
  steps = vec4(dFdx(surface.uv), dFdy(surface.uv));
  eye = vec4(view_at(surface.position) * object_from_local, 0.0);
  for (int i = 0; i < LIGHT_COUNT; ++i) {
    vec4 light = light_at(i, surface.position);
    lights[i] = vec4(light.xyz * object_from_local, light.w);
  }
}
