// What a point of the surface knows of eye, lights and projector; everything in the object's frame.

vec2 uv_width;  // how far the pixel reaches along u and v; main() says

// A direction times this is in the local frame: z along the normal, x along the tangent.
mat3 local_frame(vec3 normal, vec3 tangent) {
  vec3 x = normalize(tangent - dot(tangent, normal) * normal);
  return mat3(x, cross(normal, x), normal);
}

vec3 view_at(vec3 position) { return normalize(frame.eye.xyz - position); }

// The direction to a light, and in w what arrives of its light_rgb.
vec4 light_at(int i, vec3 position) {
  vec4 light = frame.lights[i];
  vec3 to_light = light.xyz - light.w * position;
  float closeness = 1.0 / dot(to_light, to_light);  // 1 for a direction
  return vec4(to_light * sqrt(closeness), mix(1.0, closeness, light.w));
}

// cos(theta_p) (r_ref / r)^2 of the projector's light.
float projector_geometry(vec3 normal, vec3 position) {
  vec3 to_projector = frame.projector.xyz - position;
  float nearness = 1.0 / dot(to_projector, to_projector);
  return dot(normal, to_projector) * sqrt(nearness) * (frame.projector.w * nearness);
}

// The largest half float: brighter is drawn as this, not as infinity.
const float kHalfMax = 65504.0;
// Brighter than this is no light but a fault, as what is no number is.
const float kFinite = 1e30;

// What the draw passes leave: XYZ in cd/m^2, and in alpha the geometric factor; all 0 where the
// surface faces away from the projector. A fault stays one, so that it is found out and shown dark:
// min() would make full white of what is no number.
vec4 target_of(vec3 rgb, float geometry) {
  if (!(geometry > 0.0)) return vec4(0.0);
  vec4 target = vec4(mat3(frame.xyz_from_rgb) * rgb, geometry);
  bvec4 is_bright = greaterThan(target, vec4(kHalfMax));
  bvec4 is_light = lessThan(target, vec4(kFinite));
  for (int i = 0; i < 4; ++i) {
    // Some GPUs store what half floats cannot hold as the largest that they can: white.
    if (is_bright[i]) target[i] = is_light[i] ? kHalfMax : uintBitsToFloat(0x7f800000u);
  }
  return target;
}
