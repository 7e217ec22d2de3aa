// The unit square of a direction's elevated concentric map (Schneider 2004, section 6.1), without
// branches. The double-precision counterpart is concentric_square.cc; change both or none.
vec2 concentric_square(vec3 direction) {
  vec2 a = abs(direction.xy);
  float t = min(a.x, a.y) / max(max(a.x, a.y), 1e-12);
  float u = t * t;
  float minor = t * (1.2665755 + u * (-0.3634261 + u * 0.0968506));
  float rho = 0.5 * sqrt(clamp(1.0 - direction.z, 0.0, 1.0));
  vec2 q = rho * (a.x >= a.y ? vec2(1.0, minor) : vec2(minor, 1.0));
  return 0.5 + vec2(direction.x < 0.0 ? -q.x : q.x, direction.y < 0.0 ? -q.y : q.y);
}
