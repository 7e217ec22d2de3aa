// Draws what the material would send to the eye: XYZ in cd/m^2, and in alpha the geometric factor
// cos(theta_p) (r_ref / r)^2 of the projector's light, 0 where the surface faces away from it.
in Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

layout(location = 0) out vec4 target;

// The largest half float: brighter is drawn as this, not as infinity.
const float kHalfMax = 65504.0;

void main() {
  vec3 normal = normalize(surface.normal);
  vec3 to_projector = frame.projector.xyz - surface.position;
  float nearness = 1.0 / dot(to_projector, to_projector);
  float geometry = dot(normal, to_projector) * sqrt(nearness) * (frame.projector.w * nearness);

  vec3 tangent = normalize(surface.tangent - dot(surface.tangent, normal) * normal);
  // v * object_from_local is the transposed matrix times v: into the local frame, with y = z cross x.
  mat3 object_from_local = mat3(tangent, cross(normal, tangent), normal);
  vec3 view = normalize(frame.eye.xyz - surface.position) * object_from_local;

  vec3 rgb = vec3(0.0);
  for (int i = 0; i < LIGHT_COUNT; ++i) {
    vec4 light = frame.lights[i];
    vec3 to_light = light.xyz - light.w * surface.position;
    float closeness = 1.0 / dot(to_light, to_light);  // 1 for a direction
    vec3 direction = (to_light * sqrt(closeness)) * object_from_local;
    rgb += btf_radiance(surface.uv, view, direction) *
           (frame.light_rgb[i].rgb * mix(1.0, closeness, light.w));
  }
  vec3 xyz = mat3(frame.xyz_from_rgb) * rgb;
  target = geometry > 0.0 ? min(vec4(xyz, geometry), vec4(kHalfMax)) : vec4(0.0);
}
