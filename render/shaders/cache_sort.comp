// Sorts the mesh's triangles into those that the cache can draw and the others. A triangle is drawn from
// the cache where every cell under it serves, and where the nodes tell the directions of its vertices:
// between these its directions are a blend of theirs, so that nothing curves unseen inside a cell.
layout(local_size_x = 64) in;

layout(binding = 0) uniform sampler2DArray NodeDirections;
layout(binding = 1) uniform usampler2D CacheCells;

// Position, normal, tangent, texture coordinate (mesh_buffers.cc).
const int kVertexFloats = 11;
layout(std430, binding = 0) readonly buffer Vertices { float vertices[]; };
layout(std430, binding = 1) readonly buffer Indices { uint indices[]; };
// First the cached triangles' indices, behind them the others'.
layout(std430, binding = 2) writeonly buffer Sorted { uint sorted[]; };
struct Command {
  uint count;
  uint instances;
  uint first;
  uint base_vertex;
  uint base_instance;
};
layout(std430, binding = 3) buffer Commands { Command commands[2]; };

// A triangle over more cells than this is drawn per pixel: looking at all of them would take long.
const int kMostCells = 256;

vec3 read3(uint vertex, int offset) {
  int at = int(vertex) * kVertexFloats + offset;
  return vec3(vertices[at], vertices[at + 1], vertices[at + 2]);
}

vec3 between_nodes(int layer, ivec2 cell, vec2 t) {
  vec3 near = mix(texelFetch(NodeDirections, ivec3(cell, layer), 0).xyz,
                  texelFetch(NodeDirections, ivec3(cell + ivec2(1, 0), layer), 0).xyz, t.x);
  vec3 far = mix(texelFetch(NodeDirections, ivec3(cell + ivec2(0, 1), layer), 0).xyz,
                 texelFetch(NodeDirections, ivec3(cell + ivec2(1, 1), layer), 0).xyz, t.x);
  return mix(near, far, t.y);
}

// Whether the nodes tell the directions of a vertex, which lies at `place` in units of cells.
bool told_by_nodes(uint vertex, vec2 place) {
  vec3 position = read3(vertex, 0);
  vec3 normal = normalize(read3(vertex, 3));
  if (projector_geometry(normal, position) <= 0.0) return false;
  ivec2 cell = min(ivec2(place), ivec2(kCells) - 1);
  vec2 t = place - vec2(cell);
  mat3 object_from_local = local_frame(normal, read3(vertex, 6));
  float off = distance(between_nodes(0, cell, t), view_at(position) * object_from_local);
  for (int i = 0; i < LIGHT_COUNT; ++i)
    off = max(off, distance(between_nodes(1 + i, cell, t),
                            light_at(i, position).xyz * object_from_local));
  return off <= kMostTurn;
}

bool is_served(uvec3 triangle) {
  vec2 places[3];
  for (int i = 0; i < 3; ++i) {
    vec4 clip = frame.clip_from_object * vec4(read3(triangle[i], 0), 1.0);
    if (clip.w <= 0.0) return false;
    places[i] = (clip.xy / clip.w + 1.0) * 0.5 * kPixels / kSpacing + kMargin;
    if (any(lessThan(places[i], vec2(0.0))) || any(greaterThan(places[i], kCells))) return false;
  }
  ivec2 first = ivec2(min(min(places[0], places[1]), places[2]));
  ivec2 last = min(ivec2(max(max(places[0], places[1]), places[2])), ivec2(kCells) - 1);
  ivec2 span = last - first + 1;
  if (span.x * span.y > kMostCells) return false;
  for (int y = first.y; y <= last.y; ++y)
    for (int x = first.x; x <= last.x; ++x)
      if (texelFetch(CacheCells, ivec2(x, y), 0).r == 0u) return false;
  for (int i = 0; i < 3; ++i)
    if (!told_by_nodes(triangle[i], places[i])) return false;
  return true;
}

void main() {
  uint count = uint(indices.length()) / 3u;
  uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  uvec3 triangle = uvec3(indices[3u * i], indices[3u * i + 1u], indices[3u * i + 2u]);
  uint list = is_served(triangle) ? 0u : 1u;
  uint at = list * 3u * count + atomicAdd(commands[list].count, 3u);
  for (int k = 0; k < 3; ++k) sorted[at + uint(k)] = triangle[k];
}
