// Takes a cell from the cache whose nodes do not tell the directions on an edge that crosses it.
in Edge {
  vec3 position;
  vec3 normal;
  vec3 tangent;
} edge;

layout(binding = 0) uniform sampler2DArray NodeDirections;

layout(location = 0) out uint cached;

vec3 between_nodes(int layer, ivec2 cell, vec2 t) {
  vec3 near = mix(texelFetch(NodeDirections, ivec3(cell, layer), 0).xyz,
                  texelFetch(NodeDirections, ivec3(cell + ivec2(1, 0), layer), 0).xyz, t.x);
  vec3 far = mix(texelFetch(NodeDirections, ivec3(cell + ivec2(0, 1), layer), 0).xyz,
                 texelFetch(NodeDirections, ivec3(cell + ivec2(1, 1), layer), 0).xyz, t.x);
  return mix(near, far, t.y);
}

void main() {
  vec3 normal = normalize(edge.normal);
  if (projector_geometry(normal, edge.position) <= 0.0) discard;
  vec4 clip = frame.clip_from_object * vec4(edge.position, 1.0);
  vec2 place = (clip.xy / clip.w + 1.0) * 0.5 * kPixels / kSpacing;
  ivec2 cell = ivec2(gl_FragCoord.xy);
  vec2 t = clamp(place - vec2(cell), 0.0, 1.0);
  mat3 object_from_local = local_frame(normal, edge.tangent);
  float off = distance(between_nodes(0, cell, t), view_at(edge.position) * object_from_local);
  for (int i = 0; i < LIGHT_COUNT; ++i)
    off = max(off, distance(between_nodes(1 + i, cell, t),
                            light_at(i, edge.position).xyz * object_from_local));
  if (off <= kMostTurn) discard;
  cached = 0u;
}
