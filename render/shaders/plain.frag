// The yardstick of the benchmark: one filtered fetch times the lights' cosines, with the interpolants and
// the target of draw.frag and nothing else of it.
in Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

layout(location = 0) out vec4 target;
uniform sampler2D Albedo;

void main() {
  vec3 normal = normalize(surface.normal);
  vec3 light = vec3(0.0);
  for (int i = 0; i < LIGHT_COUNT; ++i) {
#ifdef POINT_LIGHTS
    vec4 at = light_at(i, surface.position);
#else
    vec4 at = vec4(frame.lights[i].xyz, 1.0);
#endif
    light += max(dot(normal, at.xyz), 0.0) * at.w * frame.light_rgb[i].rgb;
  }
  // Alpha is of no use; it keeps the compiler from dropping the two interpolants that nothing else reads.
  target = vec4(texture(Albedo, fract(surface.uv)).rgb * light, dot(surface.position, surface.tangent));
}
