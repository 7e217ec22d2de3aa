// Functions of view and light in a volume (cluster_volume.h). Before this stand its constants.

// Where the volume is read: the lower of two neighbouring rows of light nodes, and how far the light
// is towards the upper.
struct VolumePlace {
  vec3 at;
  float upper;
};

VolumePlace volume_place(uint cluster, vec3 view, vec3 light) {
  vec2 corner = vec2(float(cluster & kClusterMask), float(cluster >> kClusterShift)) * kViewNodes;
  vec2 v = concentric_square(view) * (kViewNodes - 1.0);
  vec2 l = concentric_square(light) * (kLightNodes - 1.0);
  float row = min(floor(l.y), kLightNodes - 2.0);
  VolumePlace place;
  place.at = vec3((corner + v + 0.5) / kVolumeSize,
                  (row * kLightNodes + l.x + 0.5) / (kLightNodes * kLightNodes));
  place.upper = l.y - row;
  return place;
}

vec4 volume_fetch(sampler3D volume, VolumePlace place, float storey) {
  vec3 at = place.at + vec3(0.0, storey * kStorey, 0.0);
  return mix(textureLod(volume, at, 0.0),
             textureLod(volume, at + vec3(0.0, 0.0, 1.0 / kLightNodes), 0.0), place.upper);
}
