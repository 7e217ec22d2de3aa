// The mesh in the raster of cells, for its edges: what curves between the nodes shows on them.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 tangent;

out Edge {
  vec3 position;
  vec3 normal;
  vec3 tangent;
} edge;

void main() {
  edge.position = position;
  edge.normal = normal;
  edge.tangent = tangent;
  gl_Position = frame.clip_from_object * vec4(position, 1.0);
  // The last cells of a row may reach beyond the raster.
  vec2 part = kPixels / (kSpacing * kCells);
  gl_Position.xy = part * gl_Position.xy + (part - 1.0) * gl_Position.w;
}
