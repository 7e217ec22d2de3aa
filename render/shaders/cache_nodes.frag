// Directions in the local frame at the nodes of the cache: the view, then each light. w is 1 where a
// node sees a side of the surface that faces the projector.
in Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

layout(location = 0) out vec4 directions[1 + LIGHT_COUNT];

void main() {
  vec3 normal = normalize(surface.normal);
  mat3 object_from_local = local_frame(normal, surface.tangent);
  float seen = projector_geometry(normal, surface.position) > 0.0 ? 1.0 : 0.0;
  directions[0] = vec4(view_at(surface.position) * object_from_local, seen);
  for (int i = 0; i < LIGHT_COUNT; ++i)
    directions[1 + i] = vec4(light_at(i, surface.position).xyz * object_from_local, seen);
}
