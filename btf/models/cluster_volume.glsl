// Functions of view and light in a volume (cluster_volume.h). Before this stand its constants.

// Where the volume is read: the lower of two neighbouring rows of nodes in z, and how far the
// direction is towards the upper.
struct VolumePlace {
  vec3 at;
  float upper;
};

// The place of a direction among the nodes of a grid; outside its box that of the border.
vec2 grid_place(vec3 direction, vec2 from, vec2 scale, vec2 nodes) {
  return clamp((concentric_square(direction) - from) * scale, vec2(0.0), nodes - 1.0);
}

VolumePlace volume_place(uint cluster, vec3 view, vec3 light) {
  vec2 v = grid_place(view, kViewFrom, kViewScale, kViewNodes);
  vec2 l = grid_place(light, kLightFrom, kLightScale, kLightNodes);
  vec2 plane = kLightsInPlane ? l : v;
  vec2 beyond = kLightsInPlane ? v : l;
  vec2 plane_nodes = kLightsInPlane ? kLightNodes : kViewNodes;
  vec2 beyond_nodes = kLightsInPlane ? kViewNodes : kLightNodes;
  vec2 corner = vec2(float(cluster & kClusterMask), float(cluster >> kClusterShift)) * plane_nodes;
  // A single row or column of nodes is one line of them in z.
  float row = kOneFetch ? beyond.y : min(floor(beyond.y), beyond_nodes.y - 2.0);
  VolumePlace place;
  place.at = vec3((corner + plane + 0.5) / kVolumeSize,
                  (row * beyond_nodes.x + beyond.x + 0.5) / (beyond_nodes.x * beyond_nodes.y));
  place.upper = beyond.y - row;
  return place;
}

vec4 volume_fetch(sampler3D volume, VolumePlace place, float storey) {
  vec3 at = place.at + vec3(0.0, storey * kStorey, 0.0);
  vec4 lower = textureLod(volume, at, 0.0);
  if (kOneFetch) return lower;
  return mix(lower, textureLod(volume, at + vec3(0.0, 0.0, 1.0 / kLightNodes.y), 0.0), place.upper);
}
