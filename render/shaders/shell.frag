// One layer of the material, as a shell around the mesh: the nearest of those shells that lie behind what
// was drawn before. Before this stand the model and kShells, the number of its layers.
in Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

layout(location = 0) out vec4 shell;  // XYZ in cd/m^2; how much it hides of what lies behind
uniform sampler2D Nearer;             // depth of what the last turn drew
uniform sampler2D Seen;               // all turns before this one
uniform int shell_layer;

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  // Written as it is compared, so that no fragment comes twice.
  gl_FragDepth = gl_FragCoord.z;
  if (!(gl_FragCoord.z < texelFetch(Nearer, pixel, 0).r)) discard;
  if (texelFetch(Seen, pixel, 0).a >= 1.0) discard;

  vec3 normal = normalize(surface.normal);
  mat3 object_from_local = local_frame(normal, surface.tangent);
  vec3 view = view_at(surface.position) * object_from_local;
  if (!(view.z > 0.0)) {
    // The lowest is the solid itself: what faces away is dark and still hides, as draw.frag has it.
    if (shell_layer < kShells - 1) discard;
    shell = vec4(0.0, 0.0, 0.0, 1.0);
    return;
  }
  vec3 rgb = vec3(0.0);
  float hides = 0.0;
  for (int i = 0; i < LIGHT_COUNT; ++i) {
    vec4 light = light_at(i, surface.position);
    vec4 seen = btf_shell(shell_layer, surface.uv, view, light.xyz * object_from_local);
    rgb += seen.rgb * (frame.light_rgb[i].rgb * light.w);
    hides = seen.a;
  }
  if (!(hides > 0.0 || rgb != vec3(0.0))) discard;
  shell = vec4(mat3(frame.xyz_from_rgb) * rgb, hides);
}
