// The yardstick of the benchmark: one filtered fetch times the light's cosine, with the interpolants and
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
  float cosine = max(dot(normalize(surface.normal), frame.lights[0].xyz), 0.0);
  vec3 rgb = texture(Albedo, fract(surface.uv)).rgb * frame.light_rgb[0].rgb;
  // Alpha is of no use; it keeps the compiler from dropping the two interpolants that nothing else reads.
  target = vec4(rgb * cosine, dot(surface.position, surface.tangent));
}
