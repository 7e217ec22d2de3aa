// Which cells between four nodes may be drawn from the cache: all corners see the surface, and no
// direction turns by more than kMostTurn between them.
layout(binding = 0) uniform sampler2DArray NodeDirections;

layout(location = 0) out uint cached;

void main() {
  ivec2 cell = ivec2(gl_FragCoord.xy);
  float turn = 0.0;
  float seen = 1.0;
  for (int layer = 0; layer < 1 + LIGHT_COUNT; ++layer) {
    vec4 a = texelFetch(NodeDirections, ivec3(cell, layer), 0);
    vec4 b = texelFetch(NodeDirections, ivec3(cell + ivec2(1, 0), layer), 0);
    vec4 c = texelFetch(NodeDirections, ivec3(cell + ivec2(0, 1), layer), 0);
    vec4 d = texelFetch(NodeDirections, ivec3(cell + ivec2(1, 1), layer), 0);
    seen *= a.w * b.w * c.w * d.w;
    turn = max(turn, max(max(distance(a, b), distance(a, c)), max(distance(d, b), distance(d, c))));
    turn = max(turn, max(distance(a, d), distance(b, c)));
  }
  cached = seen > 0.0 && turn <= kMostTurn ? 1u : 0u;
}
