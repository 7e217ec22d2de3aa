// Where a cluster's functions of the half angle are read (half_angle.h). Before this stand its
// constants. The double-precision counterpart is half_angle.cc; change both or none.
vec3 half_angle_place(uint cluster, vec3 view, vec3 light) {
  view.z = max(view.z, 0.0);
  vec3 sum = view + light;
  vec3 apart = view - light;
  float sum_square = max(dot(sum, sum), 1e-12);
  float apart_square = dot(apart, apart);
  float half_square = dot(sum.xy, sum.xy) / sum_square;
  float root = sqrt(sum_square);
  vec3 place = vec3(sqrt(half_square / (1.0 + sum.z / root)),
                    0.5 * sqrt(apart_square / (1.0 + 0.5 * root)),
                    apart.z * apart.z / max(apart_square * half_square, 1e-12));
  vec2 corner = vec2(float(cluster & kHalfAngleMask), float(cluster >> kHalfAngleShift)) *
                kHalfAngleNodes.xy;
  return (vec3(corner, 0.0) + min(place, 1.0) * (kHalfAngleNodes - 1.0) + 0.5) / kHalfAngleSize;
}
