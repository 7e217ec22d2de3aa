layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 tangent;
layout(location = 3) in vec2 texture_coordinate;

out Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

#ifdef SHELLS
uniform float shell_height;  // above the mesh, metres
#endif

// Two programs draw one mesh, and their triangles must meet.
invariant gl_Position;

void main() {
  vec3 place = position;
#ifdef SHELLS
  place += shell_height * normal;
#endif
  surface.position = place;
  surface.normal = normal;
  surface.tangent = tangent;
  surface.uv = texture_coordinate * frame.texture_repeats;
  gl_Position = frame.clip_from_object * vec4(place, 1.0);
}
