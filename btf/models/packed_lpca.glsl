// Scalar Eigen-BRDFs packed four to an RGBA volume (packed_lpca.h). Before this stand the constants
// and samplers of one material, behind it packed_evaluate().

// Where the volumes are read: the lower of two neighbouring rows of light nodes, and how far the
// light is towards the upper.
struct PackedPlace {
  vec3 at;
  float upper;
};

PackedPlace packed_place(uint cluster, vec3 view, vec3 light) {
  vec2 corner = vec2(float(cluster & kClusterMask), float(cluster >> kClusterShift)) * kViewNodes;
  vec2 v = concentric_square(view) * (kViewNodes - 1.0);
  vec2 l = concentric_square(light) * (kLightNodes - 1.0);
  float row = min(floor(l.y), kLightNodes - 2.0);
  PackedPlace place;
  place.at = vec3((corner + v + 0.5) / kVolumeSize,
                  (row * kLightNodes + l.x + 0.5) / (kLightNodes * kLightNodes));
  place.upper = l.y - row;
  return place;
}

vec4 packed_fetch(sampler3D volume, PackedPlace place) {
  return mix(textureLod(volume, place.at, 0.0),
             textureLod(volume, place.at + vec3(0.0, 0.0, 1.0 / kLightNodes), 0.0), place.upper);
}
